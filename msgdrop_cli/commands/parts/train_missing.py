"""Trains what the page's open claims lack, breadth first, until the time is up.

Every variant gets seed 1 before any gets seed 2, so that a study cut short is balanced.
"""

import re
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from msgdrop_cli.commands.parts import console
from msgdrop_cli.commands.parts.estimate import (
    Estimate,
    check_folder,
    check_memory,
    cohorts,
    estimate,
)
from msgdrop_cli.commands.parts.progress import Watch, Watched, run_name
from msgdrop_cli.commands.parts.survey import Survey, Wanted, survey
from msgdrop_cli.commands.parts.words import duration, several
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.definition.strict import shown
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.ours import delete_leftovers
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.scheduler import Task, run_tasks
from msgdrop_cli.stopping import Stopped, graceful_stop

_BUDGET = re.compile(r"(\d+(?:\.\d+)?)\s*(h|min|s)")
_UNITS = {"h": 3600.0, "min": 60.0, "s": 1.0}
_LONGEST_S = 366 * 24 * 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Means:
    """What training may use."""

    workers: int
    device: str
    ends: float | None
    """By time.monotonic(); None: when everything is there."""


def seconds(text: str) -> float:
    """Seconds that `--budget` allows: `6h`, `90min`. DefinitionError for anything else."""
    found = _BUDGET.fullmatch(text.strip())
    allowed = float(found[1]) * _UNITS[found[2]] if found else 0.0
    if not 0.0 < allowed <= _LONGEST_S:
        raise DefinitionError(f"--budget: expected a time (6h, 90min, 30s), not {shown(text)}")
    return allowed


def breadth_first(wanted: Sequence[Wanted]) -> list[Wanted]:
    """Each run once, for all that want it, seed by seed; of one seed in the order given."""
    once: dict[str, Wanted] = {}
    for each in wanted:
        known = once.setdefault(each.run.run_id, each)
        channels = tuple(dict.fromkeys((*known.channels, *each.channels)))
        episodes = max(known.episodes, each.episodes)
        once[each.run.run_id] = replace(known, channels=channels, episodes=episodes)
    return sorted(once.values(), key=lambda each: each.run.spec.seed)


def train_missing(
    wanted: Sequence[Wanted], finished: Sequence[RunRecord], root: Path, means: Means
) -> int:
    """Train and evaluate these runs in the order of `breadth_first`; returns the exit code.

    When the budget is spent, whoever is at work writes a checkpoint; the same command goes on.
    Raises DefinitionError and RecordError before anything is written, and Stopped.
    """
    looked_up = survey(breadth_first(wanted), root)
    pending = {run.run_id for run in looked_up.pending}
    todo = [each for each in breadth_first(wanted) if each.run.run_id in pending]
    if not todo:
        console.note("nothing to train")
        return 0
    tasks = _tasks(todo, root, means.device)
    cost = _cost(todo, looked_up, finished, root, means)
    left_s = _LONGEST_S if means.ends is None else means.ends - time.monotonic()
    if left_s <= 0.0:
        console.note("the page alone takes all of the --budget; nothing is trained")
        return 0
    stop = "" if means.ends is None else f", stopped after {duration(left_s)}: the page comes after"
    time_s = f"about {duration(cost.seconds)} ({cost.source})"
    console.note(f"{several(len(todo), 'run')} to train, {time_s}{stop}")
    delete_leftovers(looked_up.own)
    watched = [
        Watched(
            run_id=each.run.run_id,
            name=run_name(each.run.spec.environment, each.run.label, each.run.spec.seed),
            path=looked_up.place(each.run, root),
            train_env_steps=each.run.spec.training.train_env_steps,
            env_steps=looked_up.env_steps(each.run),
        )
        for each in todo
    ]
    with graceful_stop() as control, Watch(watched, control) as watch:
        clock = threading.Timer(left_s, control.ask)
        clock.daemon = True
        clock.start()
        try:
            outcomes = run_tasks(tasks, control, workers=means.workers, finished=watch.finished)
        finally:
            clock.cancel()
            clock.join()
        if control.signal is not None:
            raise Stopped(control.signal)
    if any(each.status == "interrupted" for each in outcomes):
        console.note("the time is up; the same command goes on")
    failed = [each.exit_code for each in outcomes if each.status not in ("done", "interrupted")]
    return max(failed, default=0)


def _tasks(todo: Sequence[Wanted], root: Path, device: str) -> list[Task]:
    """Cohorts of one seed and one evaluation, so that stacking does not undo the order."""
    found: dict[tuple[int, tuple[Channel, ...], int], list[PlannedRun]] = {}
    for each in todo:
        key = (each.run.spec.seed, each.channels, each.episodes)
        found.setdefault(key, []).append(each.run)
    return [
        Task(root=root, train=cohort, channels=channels, episodes=episodes, device=device)
        for (_, channels, episodes), runs in found.items()
        for cohort in cohorts(runs, device)
    ]


def _cost(
    todo: Sequence[Wanted],
    looked_up: Survey,
    finished: Sequence[RunRecord],
    root: Path,
    means: Means,
) -> Estimate:
    """What all of it takes, after a check of memory and disk."""
    runs = tuple(each.run for each in todo)
    cost = estimate(
        replace(looked_up, runs=runs),
        cohorts(runs, means.device),
        finished,
        workers=means.workers,
        device=means.device,
        episodes=max(each.episodes for each in todo),
        evaluations=max(len(each.channels) for each in todo),
    )
    check_memory(cost.memory_bytes, means.device)
    check_folder(root, cost.disk_bytes)
    return cost
