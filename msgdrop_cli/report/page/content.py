"""What the page shows, and as which words and numbers; HTML, Markdown and JSON are made of it."""

import io
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from msgdrop_cli.analysis.provenance import Dropped, Maker
from msgdrop_cli.analysis.reproduction import (
    WORDS,
    Decides,
    Line,
    Reading,
    Section,
    counts,
)
from msgdrop_cli.analysis.verdict import Word
from msgdrop_cli.definition.statements import Register
from msgdrop_cli.report.table import NOTHING, Table

PAPER = (
    "Woojun Kim, Myungsik Cho, Youngchul Sung: Message-Dropout: An Efficient Training Method for "
    "Multi-Agent Deep Reinforcement Learning, AAAI-19, arXiv 1902.06527"
)
MEANINGS: Mapping[Word, str] = {
    "supported": "at a registered look the test rejects that there is no difference, and the "
    "difference is the paper's",
    "contradicted": "at a registered look the test rejects that there is no difference, and the "
    "difference is the other way",
    "level": "surely so small that it does not matter: within the registered margin",
    "undecided": "none of these at the registered looks there were",
    "estimate": "no verdict: its question has no registration of looks and alpha",
    "under-specified": "registered readings of the paper decide it differently",
    "not run": "one of its arms has no finished run here, or no evaluation with this channel",
}


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure, drawn."""

    name: str
    alt: str
    png: bytes


def with_few_colours(png: bytes) -> bytes:
    """The same picture in 256 colours, as no eye can tell, in a third of the bytes."""
    from PIL import Image

    few = io.BytesIO()
    with Image.open(io.BytesIO(png)) as picture:
        how = Image.Quantize.MAXCOVERAGE  # keeps rare colours, and white as it is
        picture.convert("RGB").quantize(256, how, dither=Image.Dither.NONE).save(few, "PNG")
    return few.getvalue()


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """All of it."""

    sections: tuple[Section, ...]
    pictures: Mapping[str, tuple[Picture, ...]]
    """By a section's key."""
    tables: Mapping[str, tuple[Table, ...]]
    register: Register
    readings: Mapping[str, str]
    """What each registered reading says."""
    makers: tuple[Maker, ...]
    dropped: tuple[Dropped, ...]
    altered: tuple[str, ...]
    """Of published files that differ from the list beside them, in words."""
    folder: str
    """Where the records are."""
    origin: str
    """Which of their finished runs are published; empty without any."""
    version: str
    commit: str | None
    """Of the program that made the page."""

    @property
    def lines(self) -> list[Line]:
        """Every claim."""
        return [line for section in self.sections for line in section.lines]

    @property
    def words(self) -> list[Word]:
        """Those that it shows; `estimate`, which no registered question gives, only where it is."""
        found = {line.word for line in self.lines}
        return [word for word in WORDS if word != "estimate" or word in found]

    @property
    def counts(self) -> dict[Word, int]:
        """Of the paper's claims, by word."""
        return counts(line for line in self.lines if line.papers)

    def under_readings(self) -> dict[Word, int]:
        """Of these, how many have their word under a reading that is not the default only."""
        return counts(line for line in self.lines if line.papers and _under_another(line))

    def other_readings(self) -> str:
        """Which readings these are, in words."""
        found = {line.shown.readings for line in self.lines if line.shown and _under_another(line)}
        names = sorted({name for each in found for name in each})
        return f"reading {names[0]}" if len(names) == 1 else "other readings"

    def times(self) -> str:
        """What minutes on the page assume."""
        found = dict.fromkeys(line.decides.source for line in self.lines if line.decides)
        told = "; or ".join(source for source in found if source)
        estimate = "Minutes are those of msgdrop ablate --dry-run for the same runs"
        return f"{estimate} ({told})." if told else f"{estimate}."

    def document(self) -> dict[str, Any]:
        """The page for programs; pictures and tables, which are made of the same, left out."""
        return {
            "schema": 1,
            "paper": PAPER,
            "msgdrop": self.version,
            "commit": self.commit,
            "records": self.folder,
            "altered": list(self.altered),
            "origin": self.origin,
            "counts": self.counts,
            "counts_under_other_readings": self.under_readings(),
            "sections": [asdict_plain(section) for section in self.sections],
            "unclaimed": [list(pair) for pair in self.register.unclaimed],
            "deviations": [asdict(each) for each in self.register.statements if each.is_ours],
            "machines": [asdict(each) for each in self.makers],
            "dropped": [asdict(each) for each in self.dropped],
        }


def _under_another(line: Line) -> bool:
    return line.shown is not None and bool(line.shown.readings)


def asdict_plain(section: Section) -> dict[str, Any]:
    """A section as JSON takes it: the numbers of a test by their names."""
    table = asdict(section)
    for line, row in zip(section.lines, table["lines"], strict=True):
        for reading, entry in zip(line.readings, row["readings"], strict=True):
            entry["evidence"] = reading.evidence._asdict() if reading.evidence else None
            entry["prospect"] = reading.prospect._asdict() if reading.prospect else None
    return table


def game(line: Line) -> str:
    """Where, when and through what an ordering is compared."""
    when = "in training" if line.measure == "learning" else "after training"
    through = [line.channel] if line.channel else []
    return ", ".join([line.environment, when, *through])


def metric(line: Line) -> str:
    """What is compared."""
    return line.metric.replace("_", " ")


def number(value: float | None) -> str:
    """Two decimals below 100, none above; no minus before a zero."""
    if value is None:
        return NOTHING
    text = f"{value:,.0f}" if abs(value) >= 100 else f"{value:.2f}"
    return text.removeprefix("-") if not text.strip("-0.") else text


def interval(reading: Reading) -> str:
    """`[2.44, 7.37]`; nothing for one seed."""
    if reading.low is None or reading.high is None:
        return ""
    return f"[{number(reading.low)}, {number(reading.high)}]"


def p_text(p: float) -> str:
    """Two digits."""
    return f"{p:.2g}"


def asked_under(readings: tuple[str, ...]) -> str:
    """`as written` for the default reading, else the names."""
    return ", ".join(readings) or "default"


def scale(reading: Reading) -> str:
    """Training length and profile."""
    return f"{reading.train_env_steps:,} env steps, profile {reading.profile}"


def look(reading: Reading, looks: int) -> str:
    """`look 2 of 4`."""
    return f"look {reading.evidence.look} of {looks}" if reading.evidence else "no look yet"


def duration(seconds: float) -> str:
    """`57 min`, `3.2 h`, `2.1 days`."""
    if seconds < 90 * 60:
        return f"{max(1, round(seconds / 60.0))} min"
    if seconds < 48 * 3600:
        return f"{seconds / 3600.0:.1f} h"
    return f"{seconds / 86400.0:.1f} days"


def decides(way: Decides | None) -> str:
    """What would decide a claim, and what it costs here; before that, why it may well not."""
    if way is None:
        return ""
    doubt = f"{way.unforeseen}; " if way.unforeseen else ""
    if not way.runs:
        return f"{doubt}{way.seeds} seeds, all trained: an evaluation"
    beyond = "" if way.registered else ", beyond the registered looks"
    sure = f"about {way.seeds} seeds" if way.forecast else f"next look, {way.seeds} seeds"
    if way.family:
        sure = f"its whole family at {way.seeds} seeds"
    plural = "" if way.runs == 1 else "s"
    return f"{doubt}{sure}{beyond}: {way.runs} run{plural} more, {duration(way.seconds)} here"
