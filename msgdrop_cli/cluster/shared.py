"""Tasks on workers that see the results folder: they write there as workers of this machine do."""

import platform
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import run_lock
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.store import set_status
from msgdrop_cli.scheduler import TRIES, Arrived, Elsewhere, Task, lost, work
from msgdrop_cli.stopping import Control

if TYPE_CHECKING:
    from distributed import Client, Future

GONE = "cluster: the scheduler has gone"


def on(client: "Client") -> Elsewhere:
    """What does the scheduler's tasks on this cluster (`run_tasks(elsewhere=...)`).

    A task whose worker dies is begun again elsewhere, TRIES times in all; what is lost with the
    cluster itself has failed, and goes on when it is asked for again.
    """

    def do(tasks: Sequence[Task], control: Control, arrived: Arrived) -> None:
        from distributed import as_completed

        futures = {
            client.submit(work_there, task, control, pure=False, retries=0): task for task in tasks
        }
        for future in as_completed(futures):
            task = futures.pop(future)
            if future.status == "finished":
                arrived(future.result())
            else:
                arrived(lost_by(future, task))

    return do


def lost_by(future: "Future[Any]", task: Task) -> list[Outcome]:
    """The outcomes of a task of which nothing comes back."""
    error = future.exception() if future.status == "error" else None
    reason = f"cluster: {type(error).__name__}: {error}" if error else GONE
    if type(error).__name__ == "KilledWorker":
        reason = f"cluster: its workers died {TRIES} times (killed, or out of memory?)"
    return [lost(task, run_id, reason) for run_id in task.run_ids]


def work_there(task: Task, control: Control) -> list[Outcome]:
    """What a worker does: the scheduler's own work; the record says on which machine."""
    outcomes = work(task, control)
    for outcome in outcomes:
        if outcome.path is not None and outcome.status != "interrupted":
            with suppress(RecordError), run_lock(outcome.path):
                set_status(outcome.path, outcome.status, outcome.reason, node=platform.node())
    return outcomes
