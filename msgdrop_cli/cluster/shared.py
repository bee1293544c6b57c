"""Tasks on workers that see the results folder: they write there as workers of this machine do."""

import platform
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgdrop_cli.cluster.tasks import carry
from msgdrop_cli.errors import RecordError, RunError
from msgdrop_cli.records.files import run_lock
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.store import RUNS, find_run, list_runs, set_status
from msgdrop_cli.scheduler import Arrived, Elsewhere, Task, work
from msgdrop_cli.stopping import Control

if TYPE_CHECKING:
    from distributed import Client, Future


_ENDED = ("done", "diverged", "failed")


def on(client: "Client") -> Elsewhere:
    """What does the scheduler's tasks on this cluster (`run_tasks(elsewhere=...)`)."""

    def do(tasks: Sequence[Task], control: Control, arrived: Arrived) -> None:
        carry(client, _Shared(client, control), tasks, control, arrived)

    return do


@dataclass(frozen=True, slots=True)
class _Shared:
    """Nothing travels but the task: locks, progress and the word to stop are in the folder."""

    client: "Client"
    control: Control

    def submit(self, task: Task) -> "Future[Any]":
        return self.client.submit(work_there, task, self.control, pure=False, retries=0)

    def receive(self, task: Task, result: list[Outcome]) -> list[Outcome]:
        return result

    def abandon(self, task: Task) -> None:
        pass

    def look_after(self, workers: Sequence[str]) -> None:
        pass


def work_there(task: Task, control: Control) -> list[Outcome]:
    """What a worker does: the scheduler's own work; the record says on which machine.

    Raises RunError if this worker does not see the results folder.
    """
    if not task.root.is_dir():  # it came when the others had been looked at
        raise RunError(
            f"the worker on {platform.node()} does not see {task.root}; end it and ask again"
        )
    outcomes = work(task, control)
    for run in task.train:
        with suppress(RecordError):
            _say_where(task.root, run.run_id)
    return outcomes


def _say_where(root: Path, run_id: str) -> None:
    """Note this machine in the record of a run that has ended; another question may have made it.

    As it is now: how the task ended is not how its training did.
    """
    found = find_run(root / RUNS, run_id)
    if found is not None:
        with run_lock(found.path):
            [record] = list_runs(found.path)
            if record.status in _ENDED and "node" not in record.run:
                set_status(record.path, record.run["status"], record.reason, node=platform.node())
