"""Runs before they train: each one locked, and read for what it goes on from."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine.checkpoint import Checkpoint, Checkpoints
from msgdrop_cli.engine.facts import kernel_name
from msgdrop_cli.errors import RunError
from msgdrop_cli.records.files import Epoch, count_jsonl, run_lock
from msgdrop_cli.records.ours import refuse_links
from msgdrop_cli.records.run_file import Status
from msgdrop_cli.records.store import (
    METRICS,
    RUNS,
    RunRecord,
    create_run,
    find_run,
    run_path,
    set_status,
)
from msgdrop_cli.records.times import cpu_time_s


@dataclass(slots=True)
class Run:
    """One run in training."""

    planned: PlannedRun
    epoch: Epoch
    checkpoints: Checkpoints
    checkpoint: Checkpoint | None
    wall_time_s: float
    cpu_time_s: float | None
    """None if it was begun by a program that did not measure it."""
    note: str | None
    """What the user should know about how it went on."""
    rows: int = 0
    """Rows in metrics.jsonl."""
    diverged: str | None = None

    @property
    def path(self) -> Path:
        """Its folder."""
        return self.epoch.path

    @property
    def env_steps(self) -> int:
        """Environment steps that it goes on from."""
        return self.checkpoint.counters.env_steps if self.checkpoint else 0

    def write_down(self, status: Status, reason: str | None = None, **facts: Any) -> None:
        """Put a word and facts into its record; RecordError (75) if that is another process's."""
        self.epoch.check()
        set_status(self.path, status, reason, **facts)


def lock(planned: PlannedRun, root: Path, locks: ExitStack) -> RunRecord | Epoch:
    """The run's record if it is done, or else its folder, locked from now on.

    Raises RecordError: another process trains it (75), or a link is in the way (73).
    """
    epoch: Epoch | None = None
    while True:  # look again under the lock: another process may have ended or begun it meanwhile
        record = find_run(root / RUNS, planned.run_id)
        if record is not None and record.status == "done":
            return record
        found = record.path if record is not None else run_path(root, planned)
        if epoch is not None and found == epoch.path:
            return epoch
        refuse_links(root, found)
        epoch = locks.enter_context(run_lock(found))


def open_run(planned: PlannedRun, epoch: Epoch, device: str) -> Run:
    """A run that is locked, and its newest checkpoint.

    Raises RunError if that is of another kernel or version, RecordError for damage.
    """
    path = epoch.path
    record = find_run(path, planned.run_id)
    if record is None:
        record = create_run(path, planned, {})
    checkpoints = Checkpoints(path, planned.run_id, epoch.check)
    checkpoint = checkpoints.latest(count_jsonl(path / METRICS))
    if checkpoint is not None:
        _check_kernel(checkpoint, kernel_name(planned.spec, device))
    run = Run(
        planned=planned,
        epoch=epoch,
        checkpoints=checkpoints,
        checkpoint=checkpoint,
        wall_time_s=float(record.run["wall_time_s"]),
        cpu_time_s=cpu_time_s(record) if record.env_steps else 0.0,
        note=None,
    )
    if record.env_steps > run.env_steps:
        start = f"{run.env_steps} env steps" if checkpoint else "the beginning"
        run.note = f"went on from {start}: what was newer is damaged or gone"
    return run


def _check_kernel(checkpoint: Checkpoint, kernel: str) -> None:
    """A run goes on with the arithmetic that it began with, or its result would be another."""
    began_with = checkpoint.counters.kernel
    if began_with != kernel:
        raise RunError(
            f"{checkpoint.path}: was trained with the {began_with!r} kernel, this process has"
            f" {kernel!r}, whose last bits differ; take the same msgdrop, --device, compiler and"
            f" MSGDROP_KERNEL as before, or begin the run anew in another folder"
        )
