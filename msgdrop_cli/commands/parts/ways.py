"""How each claim gets its row: the command that makes it, what would decide it, at what cost."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from msgdrop_cli.analysis.prospects import TOO_FEW
from msgdrop_cli.analysis.reproduction import Answer, Decides, Line, Reading, Section
from msgdrop_cli.analysis.sequential import deciding_looks
from msgdrop_cli.analysis.verdict import Word
from msgdrop_cli.commands.parts.answers import Answers, Scale, whole
from msgdrop_cli.commands.parts.estimate import cohorts
from msgdrop_cli.commands.parts.paces import Paces
from msgdrop_cli.commands.parts.survey import Wanted, survey_among, wanted_of
from msgdrop_cli.definition.catalogue import Catalogue
from msgdrop_cli.definition.figures import all_figures
from msgdrop_cli.definition.plan import Plan, plan
from msgdrop_cli.definition.run_id import run_ids
from msgdrop_cli.definition.spec import Definition, PlannedRun, Registration

_OPEN: tuple[Word, ...] = ("undecided", "not run")
_REJECTED: tuple[Word, ...] = ("supported", "contradicted")
_PAPER = "paper"
"""Profiles of the paper's length begin with it: days, so not what is asked first."""


class _Asked(NamedTuple):
    """What an open claim waits for."""

    arms: Sequence[str]
    look: int | None
    """Seeds 1 to n; None if no look is left."""
    for_family: bool
    """Whether it has these seeds itself, and waits for its family."""


def with_ways(
    sections: Sequence[Section],
    answers: Answers,
    catalogue: Catalogue,
    *,
    workers: int,
    device: str,
) -> tuple[Section, ...]:
    """The same sections; every line has its command, and the open ones what would decide them.

    workers, device: what it would be trained with.
    """
    every = (*answers.records, *answers.others)
    finished = [record for record in every if record.status == "done"]
    paces = Paces(finished, workers=workers, device=device)
    guides = _guides(sections, answers, catalogue, paces)
    completed = []
    for section in sections:
        lines = (guides[line.question].complete(line, section.key) for line in section.lines)
        completed.append(replace(section, lines=tuple(lines)))
    return tuple(completed)


def wanted_runs(
    sections: Sequence[Section], answers: Answers, catalogue: Catalogue
) -> list[Wanted]:
    """The runs that open claims lack for their next registered look that can decide them."""
    guides = _guides(sections, answers, catalogue, Paces([], workers=1, device="cpu"))
    return [
        wanted
        for section in sections
        for line in section.lines
        if line.word in _OPEN
        for wanted in guides[line.question].wanted(line)
    ]


def _guides(
    sections: Sequence[Section], answers: Answers, catalogue: Catalogue, paces: Paces
) -> "dict[str, _Guide]":
    guides = {
        each.definition.name: _Guide(each, answers, catalogue, paces) for each in answers.answers
    }
    lines = [line for section in sections for line in section.lines]
    for guide in guides.values():
        guide.prefer([line for line in lines if line.question == guide.definition.name])
    return guides


class _Guide:
    """Knows the scales of one question, and what their runs cost here."""

    def __init__(
        self, answer: Answer, answers: Answers, catalogue: Catalogue, paces: Paces
    ) -> None:
        self.definition = answer.definition
        self.answers, self.catalogue, self.paces = answers, catalogue, paces
        self.done: dict[tuple[str, str, str], set[int]] = {}
        self.lost: dict[tuple[str, str, str], frozenset[int]] = {}
        for arm in answer.summary.arms:
            key = (arm.group.environment, arm.variant, arm.group.profile)
            self.done[key] = {record.seed for record in arm.done}
            self.lost[key] = arm.lost
        self.plans: dict[Scale, Plan] = {}
        self.usual: Scale | None = None
        self.lines: Sequence[Line] = ()

    def prefer(self, lines: Sequence[Line]) -> None:
        """Know the question's lines, and take the scale at which most of them were judged."""
        self.lines = lines
        told = Counter(line.shown.profile for line in lines if line.shown)
        if told:
            self.usual = self.answers.scales[told.most_common(1)[0][0]]

    def complete(self, line: Line, figure: str) -> Line:
        """The line with its command and what would decide it."""
        readings = tuple(self._made_by(each, line, figure) for each in line.readings)
        line = replace(line, readings=readings)
        if line.shown:
            scale, command = self.answers.scales[line.shown.profile], line.shown.command
        else:
            scale, first = self._first_scale(line), range(1, self._first_look(line) + 1)
            command = self._command(line, figure, scale, {*first})
        decides = self._decides(line, scale) if line.word in _OPEN else None
        return replace(line, command=command, decides=decides)

    def _made_by(self, reading: Reading, line: Line, figure: str) -> Reading:
        """The reading with the command that makes it again."""
        scale = self.answers.scales[reading.profile]
        seeds = self._seeds_there(line, scale)
        return replace(reading, command=self._command(line, figure, scale, seeds))

    def wanted(self, line: Line) -> list[Wanted]:
        """The runs of its family that are missing at the next look that can decide it."""
        rule, shown = self.definition.registration, line.shown
        asked = self._asked_for(line, rule) if rule else None
        if asked is None or asked.look is None:
            return []
        scale = self.answers.scales[shown.profile] if shown else self._first_scale(line)
        return self._lacking(scale, line.environment, asked.arms, asked.look)

    def _lacking(
        self, scale: Scale, environment: str, arms: Sequence[str], seeds: int
    ) -> list[Wanted]:
        """Of these arms with seeds 1 to n the runs that are nowhere, neither own nor published."""
        asked = self._plan(scale)
        found = []
        for variant in arms:
            run = self._planned(scale, environment, variant)
            for seed, name in enumerate(run_ids(run.spec, range(1, seeds + 1)), start=1):
                found.append(replace(run, spec=replace(run.spec, seed=seed), run_id=name))
        wanted = wanted_of(asked, found)
        pending = {run.run_id for run in survey_among(wanted, self.answers.copies).pending}
        return [each for each in wanted if each.run.run_id in pending]

    def _asked_for(self, line: Line, rule: Registration) -> _Asked:
        """What the claim waits for: its next look, of all arms of its family that are open.

        There is no verdict on a part of a family.
        """
        shown = line.shown
        reached = shown.evidence.seeds if shown and shown.evidence else 0
        looks = [n for n in deciding_looks(rule.in_game(line.environment)) if n > reached]
        family = (line.environment, line.measure)
        mates = [
            each
            for each in self.lines
            if (each.environment, each.measure) == family and each.word not in _REJECTED
        ]
        arms = [arm for each in (line, *mates) for arm in (each.better, each.worse)]
        waits = bool(shown and looks and shown.seeds >= looks[0])
        return _Asked(list(dict.fromkeys(arms)), looks[0] if looks else None, for_family=waits)

    def _first_look(self, line: Line) -> int:
        """The first look that can decide anything, or else the first."""
        if (rule := self.definition.registration) is None:
            return 1
        return (deciding_looks(rule.in_game(line.environment)) or rule.looks)[0]

    def _first_scale(self, line: Line) -> Scale:
        """The scale to begin with, of those at which something has both arms of the claim.

        That of its neighbours, or the one with most seeds in hours, or days.
        """
        profiles = list(self.definition.profiles)
        ranks = {
            name: (not name.startswith(_PAPER), _count(self.definition, name), place)
            for place, name in enumerate(profiles)
        }
        scales = [Scale(name, ()) for name in sorted(profiles, key=lambda n: ranks[n])[::-1]]
        if self.usual:
            scales.insert(0, self.usual)
        return next((scale for scale in scales if self._asked_by(line, scale)), scales[0])

    def _seeds_there(self, line: Line, scale: Scale) -> set[int]:
        arms = [(line.environment, arm, scale.name) for arm in (line.better, line.worse)]
        return set().union(*(self.done.get(arm, set()) | self.lost.get(arm, set()) for arm in arms))

    def _command(self, line: Line, figure: str, scale: Scale, seeds: set[int]) -> str:
        names = self._asked_by(line, scale)
        judges = [name for name in names if name in (figure, line.question)]
        name = next(iter([*judges, *names]), line.question)
        under = "".join(f" --reading {each}" for each in scale.readings)
        return f"msgdrop ablate {name} --profile {scale.profile}{under} --seeds {_listed(seeds)}"

    def _asked_by(self, line: Line, scale: Scale) -> list[str]:
        """What trains and evaluates both arms at a scale, fewest runs first: question and figures.

        Figures leave no variant out. One that shows another measure has runs for this one, too.
        """
        games, everyone = self.definition.games(scale.profile), self.definition.variants
        variants = self.definition.profiles[scale.profile].variants or everyone
        runs = {}
        if line.environment in games and {line.better, line.worse} <= set(variants):
            runs[line.question] = len(games) * len(variants)
        for name, each in all_figures().items():
            if each.question == line.question and line.environment in each.environments:
                runs[name] = len(each.environments) * len(everyone)
        return sorted(runs, key=runs.__getitem__)

    def _decides(self, line: Line, scale: Scale) -> Decides | None:
        rule, shown = self.definition.registration, line.shown
        if rule is None:
            return None
        arms, look, waits = self._asked_for(line, rule)
        prospect = shown.prospect if shown and not waits else None
        if prospect is None and look is None:
            return None
        seeds = prospect.seeds if prospect else look or 0
        lacking = self._lacking(scale, line.environment, arms, seeds)
        tasks = cohorts([each.run for each in lacking], self.paces.device)
        whole_runs = [[(run, run.spec.training.train_env_steps) for run in task] for task in tasks]
        spent, source = self.paces.of(whole_runs)
        return Decides(
            seeds=seeds,
            forecast=prospect is not None,
            registered=seeds in rule.looks,
            runs=len(lacking),
            seconds=spent.likely,
            source=source,
            family=waits,
            unforeseen="" if waits else (shown.unforeseen if shown else TOO_FEW),
        )

    def _planned(self, scale: Scale, environment: str, variant: str) -> PlannedRun:
        return next(
            run
            for run in self._plan(scale).runs
            if (run.spec.environment, run.variant) == (environment, variant)
        )

    def _plan(self, scale: Scale) -> Plan:
        """All games and variants of a scale, with seed 1 alone."""
        if scale not in self.plans:
            self.plans[scale] = plan(
                whole(self.definition),
                scale.profile,
                self.catalogue,
                readings=scale.readings,
                seeds=(1,),
            )
        return self.plans[scale]


def _count(definition: Definition, profile: str) -> int:
    seeds = definition.profiles[profile].seeds
    return seeds if isinstance(seeds, int) else len(seeds)


def _listed(seeds: set[int]) -> str:
    """What `--seeds` takes: `10` for 1 to 10, else all of them."""
    if seeds == set(range(1, len(seeds) + 1)):
        return str(len(seeds))
    return "".join(f"{seed}," for seed in sorted(seeds))
