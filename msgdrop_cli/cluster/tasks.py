"""Tasks to the workers of a cluster and outcomes back, without a wait for anybody who is silent.

As many tasks are away as there are workers. Dask begins one whose worker is lost elsewhere; what
is lost with the cluster itself has failed, and goes on when it is asked for again.
"""

import time
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, wait
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

from msgdrop_cli.cluster.connection import PATIENCE_S, Answer, asked
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import MsgdropError, RecordError
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.scheduler import Arrived, Task, lost
from msgdrop_cli.stopping import Control

if TYPE_CHECKING:
    from distributed import Client, Future

GONE = "cluster: the scheduler has gone; ask again when it is there"
NOBODY = "cluster: no worker is left; start some and ask again"
SILENT = "cluster: the scheduler does not answer (stopped?); ask again when it does"
_LOOK_AGAIN_S = 1.0


class Way(Protocol):
    """How a task gets to a worker and back, which depends on what the worker sees."""

    def submit(self, task: Task) -> "Future[Any]":
        """Hand a task to the cluster; RecordError if its runs cannot be had."""

    def receive(self, task: Task, result: Any) -> list[Outcome]:
        """Outcomes of a task from what its worker gave back."""

    def abandon(self, task: Task) -> None:
        """Nothing will come back of a task that was submitted."""

    def look_after(self, workers: Sequence[str]) -> None:
        """Called about once a second while tasks are away; must not wait for workers."""


@dataclass(slots=True)
class _Crew:
    """The workers that the scheduler knows; one that is silent may be among them."""

    client: "Client"
    workers: Sequence[str]
    question: Answer
    """Who is there, asked before anything else: what is sent may take longer than the patience."""
    seen: float = field(default_factory=time.monotonic)
    """When the scheduler last said that there is a worker, by this process's own clock."""

    def look(self) -> None:
        """Take the answer to the question, if there is one, and ask again."""
        if self.question.done():
            with suppress(Exception):
                self.workers = tuple(self.question.result())
                if self.workers:
                    self.seen = time.monotonic()
            self.question = asked(self.client, self.client.nthreads)

    def lost(self) -> str:
        """Why nothing can come of any task; empty if something can."""
        if self.client.status != "running":
            return GONE
        if time.monotonic() - self.seen <= PATIENCE_S:
            return ""
        return SILENT if self.workers else NOBODY


def carry(
    client: "Client", way: Way, tasks: Sequence[Task], control: Control, arrived: Arrived
) -> None:
    """Do tasks on a cluster; see `scheduler.Elsewhere`."""
    waiting = list(tasks)
    away: dict[Answer, Task] = {}
    crew = _Crew(client, tuple(client.nthreads()), asked(client, client.nthreads))
    while not (reason := crew.lost()):
        while waiting and len(away) < max(1, len(crew.workers)) and not control.stopping():
            _send(client, way, waiting.pop(0), away, arrived)
        if not away:
            return
        for answer in wait(away, _LOOK_AGAIN_S, FIRST_COMPLETED).done:
            arrived(_received(way, away.pop(answer), answer))
        crew.look()
        way.look_after(crew.workers)
    for task in away.values():
        way.abandon(task)
    for task in (*away.values(), *waiting):
        arrived([lost(task, run_id, reason) for run_id in task.run_ids])


def _send(
    client: "Client", way: Way, task: Task, away: dict[Answer, Task], arrived: Arrived
) -> None:
    """Submit a task and have its result fetched, which Dask does anew if that is lost first."""
    try:
        future = way.submit(task)
    except RecordError as error:
        outcomes = [lost(task, run_id, str(error)) for run_id in task.run_ids]
        arrived([replace(each, exit_code=error.exit_code) for each in outcomes])
    else:
        away[asked(client, client.gather, future)] = task


def _received(way: Way, task: Task, answer: Answer) -> list[Outcome]:
    """The outcomes of a task that has come back, or of which nothing will."""
    try:
        result = answer.result()
    except Exception as error:
        way.abandon(task)
        return [lost(task, run_id, _why(error)) for run_id in task.run_ids]
    return way.receive(task, result)


def _why(error: Exception) -> str:
    """Why nothing comes back."""
    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError

    if isinstance(error, MsgdropError):
        return f"cluster: {error}"
    if isinstance(error, KilledWorker):
        deaths = error.allowed_failures + 1
        return f"cluster: its workers died {deaths} times (killed, or out of memory?)"
    if isinstance(error, (CancelledError, CommClosedError)):
        return GONE
    return one_line(f"cluster: {type(error).__name__}: {error}")
