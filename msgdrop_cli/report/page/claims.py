"""The claims of a section as a table: a row for each, and below it why and how to make it again."""

from collections.abc import Mapping
from itertools import groupby

from msgdrop_cli.analysis.reproduction import Line, Reading, Section
from msgdrop_cli.analysis.verdict import Word
from msgdrop_cli.report.page.content import (
    asked_under,
    decides,
    game,
    interval,
    look,
    metric,
    number,
    p_text,
    scale,
)
from msgdrop_cli.report.page.elements import Html, el, join
from msgdrop_cli.report.page.marks import Axis, axes_of, axis_key, drawn
from msgdrop_cli.report.table import NOTHING

_HEADERS = ("compared", "difference [95%]", "p", "seeds", "verdict", "what would decide")
_SORTED = ("text", "number", "number", "number", "number", "number")
_SIGNS: Mapping[Word, str] = {
    "supported": "✓",
    "contradicted": "✗",
    "level": "=",
    "undecided": "?",
    "estimate": "~",
    "under-specified": "≠",
    "not run": NOTHING,
}


def chip(word: Word) -> Html:
    """A verdict's word in its colour, told apart without colours by its sign, too."""
    name = word.replace(" ", "-")
    return el("span", el("span", _SIGNS[word], aria_hidden="true"), f" {word}",
              class_=f"chip {name}")  # fmt: skip


def claims_table(section: Section, words: list[Word]) -> Html:
    """All claims of a section, sentence by sentence. words: their order when sorted by verdict."""
    axes = axes_of(section.lines)
    head = el("thead", el("tr", *(
        el("th", title, scope="col", data_sort=kind)
        for title, kind in zip(_HEADERS, _SORTED, strict=True)
    )))  # fmt: skip
    bodies = []
    for (says, source), lines in groupby(section.lines, key=lambda line: (line.says, line.source)):
        heading = el("th", join(f"“{says}” ", el("cite", source)), colspan="6", scope="rowgroup")
        bodies.append(el("tbody", el("tr", heading), class_="sentence"))
        bodies += [_claim(line, section, axes.get(axis_key(line)), words) for line in lines]
    caption = el("caption", f"Claims of {section.title}", class_="unseen")
    return el("table", caption, head, *bodies, class_="claims")


def _claim(line: Line, section: Section, axis: Axis | None, words: list[Word]) -> Html:
    reading = line.shown
    said = el("span", f"“{line.says}” {line.source}", class_="said")
    compared = join(
        el("b", line.better_label), " beats ", el("b", line.worse_label), el("br"),
        el("small", f"{game(line)}"),
    )  # fmt: skip
    cells = [
        el("th", said, compared, scope="row", data_v=f"{line.better_label} {line.worse_label}"),
        *_numbers(line, reading, section, axis),
        _cell("verdict", join(chip(line.word), _under(line)), str(words.index(line.word))),
        _cell("what would decide", el("small", decides(line.decides) or NOTHING),
              str(line.decides.seconds) if line.decides else ""),
    ]  # fmt: skip
    more = el("td", _details(line, section), colspan="6")
    return el(
        "tbody",
        el("tr", *cells, class_="row"),
        el("tr", more, class_="more"),
        class_="claim",
        id=line.key,
        data_word=line.word,
        data_find=_findable(line, section),
    )


def _numbers(
    line: Line, reading: Reading | None, section: Section, axis: Axis | None
) -> list[Html]:
    if reading is None:
        return [_cell(name, NOTHING, "") for name in _HEADERS[1:4]]
    estimate = join(
        drawn(reading, axis), el("br"), number(reading.difference), " ",
        el("span", interval(reading), class_="quiet"),
    )  # fmt: skip
    evidence, rule = reading.evidence, section.registration
    p = join(NOTHING)
    seeds = join(str(reading.seeds))
    if evidence:
        least = f"family {p_text(evidence.p_family)}, least {p_text(evidence.smallest_p)}"
        p = join(p_text(evidence.p), el("br"), el("small", least))
    if rule:
        spent = f", alpha {evidence.alpha_spent:g} of {evidence.alpha:g}" if evidence else ""
        where = f"{look(reading, len(rule.looks))}{spent}"
        seeds = join(seeds, el("br"), el("small", where))
    if reading.lost:
        seeds = join(seeds, el("br"), el("small", f"{reading.lost} lost", class_="warn"))
    difference = "" if reading.difference is None else str(reading.difference)
    return [
        _cell(f"{metric(line)} [95%]", estimate, difference, "difference"),
        _cell("p", p, str(evidence.p) if evidence else ""),
        _cell("seeds", seeds, str(reading.seeds)),
    ]


def _cell(label: str, inside: str, value: str, class_: str | None = None) -> Html:
    """A cell that knows its column, for narrow screens, and what it is sorted by."""
    return el("td", el("div", inside), data_label=label, data_v=value, class_=class_)


def _under(line: Line) -> Html:
    """Which reading the word is of, where it is not the default one, and what others say."""
    notes = []
    if line.told_by is not None and (names := line.readings[line.told_by].readings):
        notes.append(f"under reading {', '.join(names)}")
    for number_, each in enumerate(line.readings):
        if number_ != line.told_by:
            notes.append(f"{asked_under(each.readings)} ({each.profile}): {each.word}")
    return join(*(join(el("br"), el("small", note)) for note in notes))


def _details(line: Line, section: Section) -> Html:
    parts = []
    if not line.readings:
        arms = f"{line.better} and {line.worse} on {line.environment}"
        parts.append(el("p", f"No finished, evaluated runs of both {arms} are here."))
    for each in line.readings:
        parts.append(el("p", f"{_told(each)}. {each.reason}."))
        runs = ", ".join(each.runs)
        parts.append(el("p", "Runs: ", el("code", runs), class_="runs"))
        if each is not line.shown:
            parts.append(el("p", "Again: ", el("code", each.command, class_="command")))
    if section.registered:
        parts.append(el("p", "Registered as ", el("code", section.registered), "."))
    again = "again" if line.readings else "for the first time"
    parts.append(
        el("p", f"This row {again}: ", el("code", line.command, class_="command"))
    )  # fmt: skip
    summary = el("summary", "why, runs, command")
    return el("details", summary, *parts)


def _told(reading: Reading) -> str:
    return f"Reading {asked_under(reading.readings)}, {scale(reading)}: {reading.word}"


def _findable(line: Line, section: Section) -> str:
    """What the search looks through."""
    words = [
        *(section.title, line.says, line.source, line.better, line.worse, line.better_label),
        *(line.worse_label, line.environment, game(line), metric(line), line.word, line.question),
        *(name for each in line.readings for name in (*each.readings, each.profile)),
    ]
    return " ".join(dict.fromkeys(" ".join(words).lower().split()))
