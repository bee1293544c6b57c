"""How long training takes here: the one estimate of every command, and what it assumes in words."""

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from statistics import median
from typing import Any, NamedTuple

from msgdrop_cli.commands.parts.shapes import Sizes, run_sizes
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.run_id import run_id, spec_to_dict
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.records.setup import Setup, read_setup
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.records.times import cpu_time_s

_RULE, _RULE_COMPILED = (0.2, 0.11), (0.1, 0.027)
"""ms of an env step on one core, and of a million of `Sizes.work`, in torch and in C: lines through
what benchmarks/throughput.py measured of all learners."""
_RULE_FACTOR, _MEASURED_FACTOR = 2.0, 1.25
"""Within what the rule is true (test_paces), and runs of equal work on a quiet machine."""
_SHORTEST_S = 1.0
"""Of a run that says how fast its machine is."""
_OWN, _PUBLISHED = "your finished runs like these", "published runs like these"
_RULE_OF_THUMB = "rule of thumb: not all of this was timed here before"


class Spent(NamedTuple):
    """Seconds, or env steps per second: the likely, the least and the most of them."""

    likely: float
    least: float
    most: float


class Took(NamedTuple):
    """What a finished run says of the speed."""

    env_steps_per_s: float
    is_own: bool
    by_cpu: bool
    """Else by the clock, so that whatever else was at work is in it."""


class Paces:
    """Knows how fast each kind of run trains here, which is looked up once.

    finished: runs that may have had the same work to do, on whichever machine. workers: tasks at
    once, of which no more than there are cores gain anything on a processor.
    """

    def __init__(
        self,
        finished: Sequence[RunRecord],
        *,
        workers: int,
        device: str,
        episodes: int = 1,
        machine: int | None = None,
    ) -> None:
        """machine: cores of the one that trains, if it is not this one."""
        self.device, self._episodes = device, episodes
        there = len(os.sched_getaffinity(0)) if machine is None else machine
        self._lanes = workers if device == "cuda" else min(workers, there)
        self._finished = [(record, _work(record.setup)) for record in finished]
        self._known: dict[str, tuple[Sizes, list[Took]]] = {}

    def sizes(self, run: PlannedRun) -> Sizes:
        """Loads torch. Raises DefinitionError for sizes that no machine can address."""
        return self._look_up(run)[0]

    def of(self, tasks: Sequence[Sequence[tuple[PlannedRun, int]]]) -> tuple[Spent, str]:
        """What cohorts take that are begun the longest first, and what that assumes, in words.

        tasks: of each cohort its runs, each with the env steps before it. A cohort's runs follow
        each other on a processor, and go side by side on a GPU.
        """
        together: Callable[[Iterable[float]], float] = max if self.device == "cuda" else sum
        taken = []
        for task in tasks:
            alone = zip(*(self._seconds(*each) for each in task), strict=True)
            taken.append(Spent(*map(together, alone)))
        busy = [(0.0, 0.0, 0.0)] * self._lanes
        for each in sorted(taken, reverse=True):
            free = busy.index(min(busy))
            likely, least, most = map(sum, zip(busy[free], each, strict=True))
            busy[free] = likely, least, most
        runs = [run for task in tasks for run, _ in task]
        return Spent(*map(max, zip(*busy, strict=True))), self._assumed(runs, len(tasks))

    def _seconds(self, run: PlannedRun, env_steps: int) -> Spent:
        sizes, took = self._look_up(run)
        pace = pace_of([each.env_steps_per_s for each in took], sizes)
        return Spent(env_steps / pace.likely, env_steps / pace.most, env_steps / pace.least)

    def _assumed(self, runs: Sequence[PlannedRun], tasks: int) -> str:
        """Where the speed of runs comes from, and what has to be true for it."""
        if not runs:
            return "nothing to train"
        took = [self._look_up(run)[1] for run in runs]
        every = [each for some in took for each in some]
        source = _RULE_OF_THUMB
        if all(took):
            who = _OWN if all(each.is_own for each in every) else _PUBLISHED
            how = "processor time" if all(each.by_cpu for each in every) else "time, load included,"
            source = f"{how} of {who}"
        if self.device == "cuda":
            return source
        lanes = min(self._lanes, tasks)
        return f"{source}; if {several(lanes, 'core')} {'is' if lanes == 1 else 'are'} free"

    def _look_up(self, run: PlannedRun) -> tuple[Sizes, list[Took]]:
        alike = run_id(replace(run.spec, seed=0))
        if alike not in self._known:
            sizes = run_sizes(run, self._episodes)
            kernel = sizes.kernel if self.device == "cpu" else self.device
            self._known[alike] = sizes, self._took(run, kernel)
        return self._known[alike]

    def _took(self, run: PlannedRun, kernel: str) -> list[Took]:
        """What finished runs say that had the same work to do.

        Imported runs and those of an older program count only if the same machine, kernel and
        device would do the work now; published ones, whose machine was of this kind, only without
        own ones, and those by the clock only without any by the processor's.
        """
        from msgdrop_cli.engine import facts

        made_by = {"device": self.device, "kernel": kernel, "host": facts.host()}
        wanted = _work(read_setup(spec_to_dict(run.spec)))
        alike = [
            record
            for record, work in self._finished
            if work == wanted and made_by.items() <= record.run.items() and record.env_steps
        ]
        took = [each for record in alike if (each := _took_by(record, self.device))]
        nearest = [each for each in took if each.is_own] or took
        return [each for each in nearest if each.by_cpu] or nearest


def pace_of(speeds: Sequence[float], sizes: Sizes) -> Spent:
    """Env steps per second.

    The range is that of what was measured, wide enough for what was not: starts and evaluations.
    """
    if not speeds:
        rule = rule_of_thumb(sizes)
        return Spent(rule, rule / _RULE_FACTOR, rule * _RULE_FACTOR)
    likely = median(speeds)
    fastest, slowest = likely * _MEASURED_FACTOR, likely / _MEASURED_FACTOR
    return Spent(likely, min(slowest, *speeds), max(fastest, *speeds))


def rule_of_thumb(sizes: Sizes) -> float:
    """Env steps per second: a part of the time does not depend on the size of the networks."""
    once, each_million = _RULE if sizes.kernel.startswith("torch") else _RULE_COMPILED
    return 1e3 / (once + each_million * sizes.work / 1e6)


def _took_by(record: RunRecord, device: str) -> Took | None:
    """Its speed; None where it was too short to have one."""
    spent = cpu_time_s(record) if device == "cpu" else None
    seconds = float(record.run["wall_time_s"]) if spent is None else spent
    if seconds <= _SHORTEST_S:
        return None
    return Took(record.env_steps / seconds, record.is_own, spent is not None)


def _work(setup: Setup | None) -> Any:
    """The settings that decide how much an env step costs; None for a record without any."""
    keys = ("learner", "network", "batch_size", "update_every_env_steps", "replay_start_env_steps")
    return setup and (setup.environment, [setup.algorithm.get(key) for key in keys])
