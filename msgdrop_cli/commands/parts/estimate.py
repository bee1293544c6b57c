"""What a plan will cost: how long its runs take, and what they fill."""

import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from msgdrop_cli.commands.parts import console
from msgdrop_cli.commands.parts.shapes import Sizes, run_sizes
from msgdrop_cli.commands.parts.survey import Survey
from msgdrop_cli.commands.parts.words import size
from msgdrop_cli.definition.cohorts import group
from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.files import CANNOT_CREATE, CANNOT_WRITE, take_lock
from msgdrop_cli.records.setup import Setup, read_setup
from msgdrop_cli.records.store import RunRecord, list_runs

_RULE, _RULE_COMPILED = (0.2, 0.11), (0.1, 0.027)
"""ms of an env step on one core, and of a million of `Sizes.work`, in torch and in C: lines through
what benchmarks/throughput.py measured of all learners."""
_RULE_FACTOR, _MEASURED_FACTOR = 2.0, 1.25
"""Within what the rule is true (test_cli_estimate), and runs of equal work on a quiet machine."""
_BYTES_AN_EPISODE = 130


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What the pending runs need."""

    seconds: float
    seconds_range: tuple[float, float]
    """What it may be instead, at the fastest and at the slowest."""
    source: str
    """Where the speed comes from."""
    disk_bytes: int
    """At the busiest moment; most of it is given back."""
    memory_bytes: int
    """Of all workers together at the busiest moment, without the program itself."""


def cohorts(runs: Sequence[PlannedRun], device: str) -> list[tuple[PlannedRun, ...]]:
    """The runs that train stacked. On a processor alone: stacking gains 5%, and a fault costs all.

    On a GPU launches are what takes the time, so all that can be: two workers would take turns.
    """
    return group(runs, len(runs) if device == "cuda" else 1) if runs else []


def estimate(
    looked_up: Survey,
    tasks: Sequence[Sequence[PlannedRun]],
    finished: Sequence[RunRecord],
    *,
    workers: int,
    device: str,
    episodes: int,
    evaluations: int,
) -> Estimate:
    """Time, disk and memory for the cohorts `tasks`; `finished`: runs whose speed may be known.

    episodes: of each of a run's `evaluations`. Loads torch, to measure the learner's size.
    Raises DefinitionError for sizes that no machine can address.
    """
    sizes = {run.run_id: run_sizes(run, episodes) for run in looked_up.pending}
    source = "measured on finished runs like these"
    busy = [(0.0, 0.0, 0.0)] * workers
    for task in tasks:
        alone = []
        for run in task:
            kernel = sizes[run.run_id].kernel if device == "cpu" else device
            speeds = _measured_speeds(run, finished, device, kernel)
            if not speeds:
                source = "rule of thumb: not all of this was timed here before"
            paces = _paces(speeds, sizes[run.run_id])
            alone.append([looked_up.env_steps_left(run) / pace for pace in paces])
        together: Callable[[Iterable[float]], float] = max if device == "cuda" else sum
        taken = map(together, zip(*alone, strict=True))
        free = busy.index(min(busy))
        likely, least, most = map(sum, zip(busy[free], taken, strict=True))
        busy[free] = likely, least, most
    likely, least, most = map(max, zip(*busy, strict=True))
    rows = episodes * evaluations * _BYTES_AN_EPISODE
    kept = sum(sizes[run.run_id].kept + rows for run in looked_up.pending)
    at_work = [sum(sizes[run.run_id].working for run in task) for task in tasks]
    memory = [sum(sizes[run.run_id].memory for run in task) for task in tasks]
    return Estimate(
        seconds=likely,
        seconds_range=(least, most),
        source=source,
        disk_bytes=kept + sum(sorted(at_work)[-workers:]),
        memory_bytes=sum(sorted(memory)[-workers:]),
    )


def finished_runs(root: Path) -> list[RunRecord]:
    """Runs to learn speeds from; a damaged one elsewhere in the folder is no matter here."""
    with suppress(RecordError):
        return [record for record in list_runs(root) if record.status == "done"]
    return []


def check_memory(needed_bytes: int, device: str) -> None:
    """Refuse (DefinitionError) to begin what does not fit into the machine; a GPU is not asked."""
    if device == "cpu" and needed_bytes > (free := free_memory()):
        raise DefinitionError(
            f"training needs {size(needed_bytes)} ({needed_bytes:,} bytes) of memory, "
            f"{size(free)} ({free:,} bytes) are free; take fewer --workers or smaller settings"
        )


def check_folder(root: Path, needed_bytes: int) -> None:
    """Refuse to begin where the results cannot be written; makes the folder.

    Raises RecordError: cannot be created (73), not writable or too little disk (74).
    """
    try:
        root.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordError(f"{root}: cannot be created: {error.strerror}", CANNOT_CREATE) from error
    try:
        with tempfile.TemporaryFile(dir=root) as probe:
            if not take_lock(probe.fileno()):
                console.note(f"{root}: has no locks: start no second command that trains here")
        free = shutil.disk_usage(root).free
    except OSError as error:
        raise RecordError(f"{root}: cannot be written: {error.strerror}", CANNOT_WRITE) from error
    if free < needed_bytes:
        raise RecordError(
            f"{os.fspath(root)}: needs {size(needed_bytes)} ({needed_bytes:,} bytes) of disk, "
            f"{size(free)} ({free:,} bytes) are free",
            CANNOT_WRITE,
        )


def free_memory() -> int:
    """Bytes that Linux could still give to a process; elsewhere, all that the machine has."""
    with suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _paces(speeds: Sequence[float], sizes: Sizes) -> tuple[float, float, float]:
    """Env steps per second: the likely, the fastest and the slowest.

    The range is that of what was measured, wide enough for what was not: starts and evaluations.
    """
    if not speeds:
        rule = _rule_of_thumb(sizes)
        return rule, rule * _RULE_FACTOR, rule / _RULE_FACTOR
    likely = median(speeds)
    fastest, slowest = likely * _MEASURED_FACTOR, likely / _MEASURED_FACTOR
    return likely, max(fastest, *speeds), min(slowest, *speeds)


def _rule_of_thumb(sizes: Sizes) -> float:
    """Env steps per second: a part of the time does not depend on the size of the networks."""
    once, each_million = _RULE if sizes.kernel.startswith("torch") else _RULE_COMPILED
    return 1e3 / (once + each_million * sizes.work / 1e6)


def _measured_speeds(
    run: PlannedRun, finished: Sequence[RunRecord], device: str, kernel: str
) -> list[float]:
    """Env steps per second of the finished runs that had the same work to do.

    Imported runs and those of an older program count only if the same machine, kernel and device
    would do the work now; published ones, whose machine was of this kind, only without others.
    """
    from msgdrop_cli.engine import facts

    made_by = {"device": device, "kernel": kernel, "host": facts.host()}
    wanted = _work(read_setup(spec_to_dict(run.spec)))
    alike = [
        record
        for record in finished
        if made_by.items() <= record.run.items()
        and float(record.run["wall_time_s"]) > 1.0
        and record.env_steps
        and _work(record.setup) == wanted
    ]
    nearest = [record for record in alike if record.is_own] or alike
    return [record.env_steps / float(record.run["wall_time_s"]) for record in nearest]


def _work(setup: Setup | None) -> Any:
    """The settings that decide how much an env step costs; None for a record without any."""
    keys = ("learner", "network", "batch_size", "update_every_env_steps", "replay_start_env_steps")
    return setup and (setup.environment, [setup.algorithm.get(key) for key in keys])
