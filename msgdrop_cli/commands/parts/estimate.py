"""What a plan will cost: how long its runs take, and what they fill."""

import os
import shutil
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from msgdrop_cli.commands.parts import console
from msgdrop_cli.commands.parts.paces import Paces
from msgdrop_cli.commands.parts.survey import Survey
from msgdrop_cli.commands.parts.words import several, size
from msgdrop_cli.definition.cohorts import group
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.files import CANNOT_CREATE, CANNOT_WRITE, take_lock
from msgdrop_cli.records.store import RunRecord, list_runs

_BYTES_AN_EPISODE = 130


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What the pending runs need."""

    seconds: float
    seconds_range: tuple[float, float]
    """What it may be instead, at the fastest and at the slowest."""
    source: str
    """Where the speed comes from, and what has to be true, in words."""
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
    machine: int | None = None,
) -> Estimate:
    """Time, disk and memory for the cohorts `tasks`; `finished`: runs whose speed may be known.

    episodes: of each of a run's `evaluations`. machine: cores of the one that does it, if it is not
    this one. Loads torch, to measure the learner's size.
    Raises DefinitionError for sizes that no machine can address.
    """
    paces = Paces(finished, workers=workers, device=device, episodes=episodes, machine=machine)
    left = [[(run, looked_up.env_steps_left(run)) for run in task] for task in tasks]
    spent, source = paces.of(left)
    rows = episodes * evaluations * _BYTES_AN_EPISODE
    kept = sum(paces.sizes(run).kept + rows for run in looked_up.pending)
    at_work = [sum(paces.sizes(run).working for run in task) for task in tasks]
    memory = [sum(paces.sizes(run).memory for run in task) for task in tasks]
    return Estimate(
        seconds=spent.likely,
        seconds_range=(spent.least, spent.most),
        source=source,
        disk_bytes=kept + sum(sorted(at_work)[-workers:]),
        memory_bytes=sum(sorted(memory)[-workers:]),
    )


def finished_runs(root: Path) -> list[RunRecord]:
    """Runs to learn speeds from; a damaged one elsewhere in the folder is no matter here."""
    with suppress(RecordError):
        return [record for record in list_runs(root) if record.status == "done"]
    return []


def crowd() -> str | None:
    """Whether others use this machine more than it can bear, in a few words; None if not.

    The load is that of all its cores, of which a batch job may have been given a few.
    """
    cores, at_work = os.cpu_count() or 1, os.getloadavg()[0]
    if at_work <= cores:
        return None
    return f"now the load is {at_work:.1f} on {several(cores, 'core')}"


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
