"""The paper as a tree: its figures, their claims, each reading that has runs, and the runs.

Computes no number: verdicts are those of `claims`. What was judged several times gets one word.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

from msgdrop_cli.analysis.claims import judge_claims
from msgdrop_cli.analysis.prospects import Prospect
from msgdrop_cli.analysis.sequential import deciding_looks
from msgdrop_cli.analysis.summary import Group, Summary
from msgdrop_cli.analysis.verdict import DECIDED, Evidence, Verdict, Word
from msgdrop_cli.definition.channel import NONE_BROKEN
from msgdrop_cli.definition.figures import Figure
from msgdrop_cli.definition.readings import held_by
from msgdrop_cli.definition.registration import registered_as
from msgdrop_cli.definition.spec import Claim, Definition, Registration

WORDS: tuple[Word, ...] = get_args(Word)
_OPEN: tuple[Word, ...] = ("undecided", "estimate")
_OF_THE_PAPER = re.compile(r"l\. \d")


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One claim under one reading of the paper, at one scale."""

    readings: tuple[str, ...]
    """Names of registered readings that differ from the default; empty for the default."""
    environment: str
    profile: str
    train_env_steps: int
    word: Word
    reason: str
    difference: float | None
    low: float | None
    high: float | None
    seeds: int
    lost: int
    """Of these with a run that failed or diverged, which counts as the worst value."""
    evidence: Evidence | None
    is_judged: bool
    """Whether it has reached a look that can decide."""
    prospect: Prospect | None
    unforeseen: str
    """Why there is none of an open claim that is judged."""
    margin: float | None
    """What is called level: a difference surely within it; None if nothing is."""
    runs: tuple[str, ...]
    """Run ids, those of `better` first."""
    command: str = ""
    """Makes it again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decides:
    """What would decide a claim that is open."""

    seeds: int
    forecast: bool
    """Whether so many would probably decide; else it is the next registered look."""
    registered: bool
    runs: int
    """That are missing, of both arms."""
    seconds: float
    """To train them here."""
    source: str
    """What that assumes, in words."""
    family: bool = False
    """Whether its look has come, and it waits for claims of its family: runs of all of them."""
    unforeseen: str = ""
    """Why so many may well not decide it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One ordering that the paper states, and all that is known of it."""

    key: str
    """For links: `figure-6-3`."""
    question: str
    says: str
    source: str
    papers: bool
    """False for what somebody else says of message-dropout."""
    better: str
    worse: str
    better_label: str
    worse_label: str
    environment: str
    metric: str
    measure: str
    channel: str
    word: Word
    told_by: int | None
    """Which of the readings says it; None if none does, or several that disagree."""
    readings: tuple[Reading, ...]
    command: str = ""
    """Makes this row again, or for the first time."""
    decides: Decides | None = None

    @property
    def shown(self) -> Reading | None:
        """The reading whose numbers stand for the claim."""
        return self.readings[self.told_by or 0] if self.readings else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A figure of the paper, or what a question claims beside its figures."""

    key: str
    title: str
    question: str
    asks: str
    source: str
    registered: str | None
    registration: Registration | None
    measures: tuple[str, ...]
    environments: tuple[str, ...]
    lines: tuple[Line, ...]

    @property
    def papers(self) -> bool:
        """Whether the paper says any of it."""
        return any(line.papers for line in self.lines)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """A question with the runs that it plans."""

    definition: Definition
    summary: Summary
    """Its arms and no others."""


def reproduce(answers: Sequence[Answer], figures: Mapping[str, Figure]) -> tuple[Section, ...]:
    """Every claim of these questions in its figure, in the paper's order; none is left out.

    Raises RecordError for learning curves that cannot be read.
    """
    lines = {each.definition.name: _lines(each) for each in answers}
    questions = {each.definition.name: each.definition for each in answers}
    asked = [each.question for each in figures.values()]
    sections = []
    for number, (name, figure) in enumerate(figures.items()):
        if figure.question not in questions:
            continue
        whole = lines[figure.question]
        mine = [line for line in whole if _shows(figure, line)]
        lines[figure.question] = [line for line in whole if line not in mine]
        sections.append(_section(name, figure, questions[figure.question], mine))
        if figure.question not in asked[number + 1 :] and lines[figure.question]:
            rest = lines.pop(figure.question)
            beside = _section(figure.question, None, questions[figure.question], rest)
            sections.append(replace(beside, title=f"{beside.title}, beside its figures"))
    sections += [
        _section(name, None, questions[name], rest) for name, rest in lines.items() if rest
    ]
    return tuple(sorted(sections, key=lambda section: not section.papers))


def counts(lines: Iterable[Line]) -> dict[Word, int]:
    """How many claims each word has, 0 included."""
    found = Counter(line.word for line in lines)
    return {word: found[word] for word in WORDS}


def one_word(readings: Sequence[Reading]) -> tuple[Word, int | None]:
    """The word for a claim, and which of its readings says it.

    Of each reading the largest scale counts that has reached a look which can decide, or else the
    largest. If these disagree, one deciding one way and one another, the paper is under-specified.
    What no registered reading is (`--set`) has been left out before.
    """
    if not readings:
        return "not run", None
    largest: dict[tuple[str, ...], int] = {}
    for number, each in enumerate(readings):
        known = largest.setdefault(each.readings, number)
        if _weight(each) > _weight(readings[known]):
            largest[each.readings] = number
    chosen = sorted(largest.values(), key=lambda number: len(readings[number].readings))
    decided = [number for number in chosen if readings[number].word in DECIDED]
    if len({readings[number].word for number in decided}) > 1:
        return "under-specified", None
    open_ones = [number for number in chosen if readings[number].word in _OPEN]
    told_by = (decided or sorted(open_ones, key=lambda n: -readings[n].seeds) or chosen)[0]
    return readings[told_by].word, told_by


def _weight(reading: Reading) -> tuple[bool, int, int]:
    return reading.is_judged, reading.train_env_steps, reading.seeds


def _lines(answer: Answer) -> list[Line]:
    definition = answer.definition
    verdicts = judge_claims(definition.claims, answer.summary, definition)
    by_claim: dict[int, list[Verdict]] = {}
    numbers = {id(claim): number for number, claim in enumerate(definition.claims)}
    for verdict in verdicts:
        by_claim.setdefault(numbers[id(verdict.claim)], []).append(verdict)
    lines = []
    for number, claim in enumerate(definition.claims):
        readings = [
            _reading(verdict, verdict.group, answer)
            for verdict in by_claim.get(number, [])
            if verdict.group is not None and (verdict.seeds or verdict.verdict != "not run")
        ]
        lines.append(_line(claim, definition, readings))
    return lines


def _reading(verdict: Verdict, group: Group, answer: Answer) -> Reading:
    claim, summary = verdict.claim, answer.summary
    arms = [
        arm
        for variant in (claim.better, claim.worse)
        for arm in summary.arms_of(group)
        if arm.variant == variant
    ]
    held = [held_by(arm.setup, group.environment) for arm in arms]
    rule = answer.definition.registration
    able = deciding_looks(rule.in_game(group.environment)) if rule else []
    interval = verdict.interval
    return Reading(
        readings=tuple(name for name in held[0] if all(name in each for each in held)),
        environment=group.environment,
        profile=group.profile,
        train_env_steps=group.train_env_steps,
        word=verdict.verdict,
        reason=verdict.reason,
        difference=verdict.difference,
        low=interval.low if interval else None,
        high=interval.high if interval else None,
        seeds=verdict.seeds,
        lost=verdict.lost,
        evidence=verdict.evidence,
        is_judged=verdict.evidence is not None and verdict.evidence.seeds in able,
        prospect=verdict.prospect,
        unforeseen=verdict.unforeseen,
        margin=rule.margin.get(claim.metric) if rule else None,
        runs=tuple(run.run_id for arm in arms for run in arm.done),
    )


def _line(claim: Claim, definition: Definition, readings: Sequence[Reading]) -> Line:
    word, told_by = one_word(readings)
    return Line(
        key="",
        question=definition.name,
        says=claim.says,
        source=claim.source,
        papers=bool(_OF_THE_PAPER.match(claim.source)),
        better=claim.better,
        worse=claim.worse,
        better_label=definition.variants[claim.better].label,
        worse_label=definition.variants[claim.worse].label,
        environment=claim.environment,
        metric=claim.metric,
        measure=claim.measure,
        channel="" if claim.channel == NONE_BROKEN else claim.channel.short,
        word=word,
        told_by=told_by,
        readings=tuple(readings),
    )


def _shows(figure: Figure, line: Line) -> bool:
    return line.environment in figure.environments and line.measure in figure.measures


def _section(
    name: str, figure: Figure | None, definition: Definition, lines: Sequence[Line]
) -> Section:
    title = definition.title
    measures = tuple(dict.fromkeys(line.measure for line in lines))
    environments = tuple(dict.fromkeys(line.environment for line in lines))
    if figure:
        title = f"Figure {name.removeprefix('figure-')}: {figure.shows}"
        measures, environments = tuple(figure.measures), figure.environments
    names = (registered_as(definition, each) for each in environments)
    return Section(
        key=name,
        title=title,
        question=definition.name,
        asks=definition.question,
        source=definition.source,
        registered=", ".join(dict.fromkeys(filter(None, names))) or None,
        registration=definition.registration,
        measures=measures,
        environments=environments,
        lines=tuple(replace(each, key=f"{name}-{n}") for n, each in enumerate(lines, start=1)),
    )
