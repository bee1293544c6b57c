"""A channel as a value, i.e. what becomes of messages on their way: its reader and its printers.

    links:0.5                      half of the links broken, as in the paper; also `half`, 0.5, 50%
    bursts:0.2,4+hold:3            a kind with its settings, then what the receiver does about it
    loss:0.5+mean+scale:one
    none+epsilon:0.02              of those who act a random choice in fifty

Which kinds exist is not known here: each is a file in `channels`, and whoever builds one has them.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal, get_args

from msgdrop_cli.definition.strict import shown
from msgdrop_cli.definition.traces import TraceFile
from msgdrop_cli.definition.typed_numbers import number
from msgdrop_cli.errors import nearest

LINKS = "links"
"""The paper's kind, broken links (l. 519-541): a share alone means it, and so do old records."""
TRACE = "trace"
"""The kind whose setting is a file."""
WORDS = {"none": 0.0, "half": 0.5, "all": 1.0}
"""Shares of broken links as people say them."""
NAMED = {
    "tmc-light": "bursts:0.015,3",
    "tmc-medium": "bursts:0.082,3",
    "tmc-heavy": "bursts:0.156,3",
    "constant": "first:1+hold:1000000",
}
"""Channels with a name. TMC (Zhang, Zhang, Lin: NeurIPS 2020) reports these three mean losses of
802.11ac links; that they are bursts of three steps is ours."""
Scale = Literal["trained", "one", "delivered"]
SCALES: tuple[Scale, ...] = get_args(Scale)
"""Of messages at execution: 1 - rate as in the paper, 1, or more where fewer arrive."""
_EXPECTED = "expected none, half, all, a share from 0 to 1 (0.3 or 30%) or kind:settings"
_RECEIVER = "after +: mean, hold:STEPS, scale:one, scale:delivered or epsilon:SHARE"
_HOLD, _LONGEST_HOLD = re.compile(r"hold:([1-9][0-9]{0,6})"), 1_000_000
_KIND = re.compile(r"[a-z][a-z0-9-]{0,63}")


@dataclass(frozen=True, slots=True)
class Channel:
    """A kind with its settings, and what receivers do; in order: broken links, then by name."""

    kind: str
    settings: tuple[float, ...] = ()
    missing: str = "zero"
    """What stands in for a message that does not arrive: `zero` as in the paper (l. 525), `hold:3`,
    the last one for so many steps, or `mean`, of all that have arrived from that sender."""
    scale: Scale = SCALES[0]
    epsilon: float = 0.0
    """The share of random actions; 0 is greedy. No matter of messages, but of evaluation."""
    file: TraceFile | None = None
    """In place of settings, of a recorded trace."""

    def __post_init__(self) -> None:
        if not _KIND.fullmatch(self.kind):
            raise ValueError(f"{shown(self.kind)} cannot name a channel")
        if (self.kind == TRACE) != (self.file is not None) or (self.file and self.settings):
            raise ValueError("a trace is a file: trace:links.csv")
        if self.kind == LINKS and not (len(self.settings) == 1 and 0 <= self.settings[0] <= 1):
            raise ValueError("broken links need one share from 0 to 1 (0.3 or 30%)")
        if self.missing not in ("zero", "mean") and not 1 <= self.hold <= _LONGEST_HOLD:
            raise ValueError(f"{_RECEIVER}, not {shown(self.missing)}")
        if self.scale not in SCALES:
            raise ValueError(f"{_RECEIVER}, not {shown('scale:' + self.scale)}")
        if not 0.0 <= self.epsilon <= 1.0:
            raise ValueError(f"epsilon is a share from 0 to 1, not {shown(self.epsilon)}")

    def __lt__(self, other: "Channel") -> bool:
        mine, theirs = (
            (each.kind != LINKS, each.kind, each.settings, str(each.file), *each._receiver)
            for each in (self, other)
        )
        return mine < theirs

    @property
    def _receiver(self) -> tuple[str, str, float]:
        return self.missing, self.scale, self.epsilon

    @property
    def hold(self) -> int:
        """For how many steps the last message stands in; 0 if it never does."""
        found = _HOLD.fullmatch(self.missing)
        return int(found[1]) if found else 0

    @property
    def plain(self) -> bool:
        """Whether receivers do what those of the paper do, and everybody acts greedily."""
        return not any(self._ends)

    @property
    def _ends(self) -> tuple[str, str, str]:
        """What stands after the kind, as far as it is not the paper's: `hold:3`, `scale:one`."""
        return (
            self.missing if self.missing != "zero" else "",
            f"scale:{self.scale}" if self.scale != SCALES[0] else "",
            f"epsilon:{_digits(self.epsilon)}" if self.epsilon else "",
        )

    @classmethod
    def read(cls, value: object) -> "Channel":
        """What people and records write: `half`, `30%`, 0.3, `links:0.3`, `kind:1,0.5+hold:3`.

        Raises ValueError for anything else; a kind that does not exist is not noticed here.
        """
        if not isinstance(value, str | int | float):
            raise ValueError(f"{_EXPECTED}, not {shown(value)}")
        text, *receiver = _parts(str(value).strip())
        if text in NAMED:
            text, *own = _parts(NAMED[text])
            receiver = [*own, *receiver]
        try:
            kind, settings = cls._read_kind(text, value)
            found: dict[str, Any] = {}
            for each in receiver:
                word, _, said = each.partition(":")
                name = word if word in ("scale", "epsilon") else "missing"
                if name in found:
                    raise ValueError("says twice what a receiver does")
                found[name] = each if name == "missing" else said
            file = TraceFile.read(settings) if isinstance(settings, str) else None
            epsilon = number(found.pop("epsilon", "0"))
            settings = () if isinstance(settings, str) else settings
            return cls(kind, settings, **found, epsilon=epsilon, file=file)
        except ValueError as error:
            more = f" ({error})" if receiver or text.partition(":")[0] == TRACE else ""
            raise ValueError(f"{_EXPECTED}, not {shown(value)}{more}") from error

    @staticmethod
    def _read_kind(text: str, value: object) -> tuple[str, tuple[float, ...] | str]:
        if text in WORDS:
            return LINKS, (WORDS[text],)
        kind, colon, settings = text.partition(":")
        if kind == TRACE:
            return TRACE, settings
        if not isinstance(value, str) or not (colon or text[:1].isalpha()):
            return LINKS, (number(text),)
        return kind, tuple(map(number, settings.split(","))) if colon else ()

    def located(self, folder: Path = Path()) -> "Channel":
        """What people ask for, with the content of its file, so that a record can tell it.

        folder: where paths that are not absolute begin. Raises ValueError for a file that cannot
        be read.
        """
        return self if self.file is None else replace(self, file=self.file.located(folder))

    @property
    def key(self) -> str:
        """`links:0.5`, `kind:1,0.5+hold:3`: what `read` reads, one text a channel."""
        settings = self._settings(",")
        ends = "".join(f"+{each}" for each in self._ends if each)
        return self.kind + ":" * bool(settings) + settings + ends

    @property
    def entry(self) -> dict[str, float | str]:
        """How rows of records and of `--json` name it; broken links as before there were others."""
        if self.is_links:
            return {"broken_links": self.settings[0]}
        return {"channel": self.key}

    @property
    def is_links(self) -> bool:
        """Whether it is the paper's test: broken links, and nothing else."""
        return self.kind == LINKS and self.plain

    @property
    def word(self) -> str:
        """For a mark on an axis: `half`, `30%`; of other kinds `kind 1, 0.5, hold 3`."""
        return self._named(links="")

    @property
    def short(self) -> str:
        """For the head of a column: `half broken`; of other kinds the word."""
        return self._named(links=" broken")

    @property
    def label(self) -> str:
        """For a sentence: `half of the links broken`; of other kinds the word."""
        return self._named(links=" of the links broken")

    def _settings(self, between: str) -> str:
        """The shortest digits that are these numbers, or what records call the file."""
        return str(self.file or between.join(map(_digits, self.settings)))

    def _named(self, links: str) -> str:
        names = {key: name for name, key in NAMED.items()}
        if name := names.get(self.key):
            return name
        settings = self._settings(", ")
        said = names.get(replace(self, missing="zero", scale=SCALES[0], epsilon=0.0).key)
        if self.kind == LINKS:
            words = {share: word for word, share in WORDS.items()}
            said = words.get(self.settings[0], f"{100 * self.settings[0]:g}%")
            said += links if self.plain else " broken"
        ends = "".join(f", {each.replace(':', ' ')}" for each in self._ends if each)
        return (said or f"{self.kind} {settings}".strip()) + ends


NONE_BROKEN = Channel(LINKS, (0.0,))
"""Every message arrives."""


def _parts(text: str) -> list[str]:
    """What stands between the `+` of a channel; that of 1e+3 is none."""
    return re.split(r"\+(?=[a-z])", text)


MANY = 5
"""So many channels side by side are a map, not bars, and rows of a table, not columns."""


def only_links(channels: Iterable[Channel]) -> bool:
    """Whether it is the paper's test: nothing but broken links."""
    return all(each.is_links for each in channels)


def played_how(channels: Iterable[Channel]) -> str:
    """What captions call evaluations through these channels."""
    if any(each.epsilon for each in channels):
        return "evaluation after training, greedy where no epsilon stands"
    return "greedy evaluation after training"


def title_of(channels: Iterable[Channel]) -> str:
    """What tables and figures call these channels side by side."""
    return "Broken links" if only_links(channels) else "Channels"


def check_each_once(channels: Sequence[Channel]) -> None:
    """Refuse (ValueError) evaluations through no channel, or through one twice."""
    if not channels or len(set(channels)) < len(channels):
        raise ValueError("expected at least one channel, each only once")


def build_channel(channel: Channel, kinds: Mapping[str, type[Any]]) -> Any:
    """What the channel does: an object of its kind's dataclass, whose fields are the settings.

    Raises ValueError: an unknown kind, or settings that it does not take; the caller knows where.
    """
    if channel.kind in (*NAMED, *WORDS):
        raise ValueError(f"{channel.key}: {channel.kind} takes no settings")
    if channel.kind not in kinds:
        known = nearest(channel.kind, [*WORDS, *NAMED, *kinds])
        raise ValueError(f"no channel is called {channel.kind!r}; {known}")
    kind = kinds[channel.kind]
    names = [field.name for field in fields(kind)]
    settings = channel.settings if channel.file is None else (channel.file,)
    if len(names) != len(settings):
        takes = ":" * bool(names) + ",".join(names).upper()
        example = Channel(channel.kind, kind.example).key
        raise ValueError(f"{channel.key}: expected {channel.kind}{takes} ({example})")
    try:
        return kind(*settings)
    except ValueError as error:
        raise ValueError(f"{channel.key}: {error}") from error


def _digits(value: float) -> str:
    """The shortest digits that are this number."""
    return repr(value).removesuffix(".0")
