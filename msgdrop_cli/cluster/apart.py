"""Tasks on workers that do not see the results folder: each run goes there and comes back whole.

The owner holds the locks of the runs that are away, so that nobody else trains them; who is at
what, and how far, is asked about once a second, and the same question carries the word to stop.
"""

import secrets
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgdrop_cli.cluster.guests import forget, hear, work_apart
from msgdrop_cli.cluster.parcels import Parcel, open_parcel, parcel
from msgdrop_cli.cluster.shared import GONE, lost_by
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import Epoch, write_json_atomic
from msgdrop_cli.records.store import PROGRESS, set_status
from msgdrop_cli.scheduler import Arrived, Elsewhere, Task, lost
from msgdrop_cli.stopping import Control

if TYPE_CHECKING:
    from distributed import Client, Future

_ASK_EVERY_S = 1.0


@dataclass(slots=True)
class _Away:
    """A task that a worker has, and the folders of its runs, which are locked here."""

    task: Task
    locks: ExitStack = field(default_factory=ExitStack)
    folders: dict[str, Path] = field(default_factory=dict)


@dataclass(slots=True)
class _Session:
    """One command's work on a cluster."""

    client: "Client"
    control: Control
    arrived: Arrived
    name: str = field(default_factory=lambda: secrets.token_hex(8))
    away: "dict[Future[Any], _Away]" = field(default_factory=dict)
    guard: threading.Lock = field(default_factory=threading.Lock)
    """Held while the folders of what is away are written to."""


def on(client: "Client") -> Elsewhere:
    """What does the scheduler's tasks on this cluster (`run_tasks(elsewhere=...)`).

    As many tasks are away as there are workers. A task whose worker dies is begun elsewhere as it
    was sent; what is lost with the cluster itself has failed, and goes on when asked for again.
    """

    def do(tasks: Sequence[Task], control: Control, arrived: Arrived) -> None:
        session = _Session(client, control, arrived)
        try:
            with _asking(session):
                _do(session, list(tasks))
        finally:
            for each in session.away.values():
                each.locks.close()

    return do


def _do(session: _Session, waiting: list[Task]) -> None:
    from distributed import as_completed

    arriving = as_completed()
    while True:
        while waiting and not session.control.stopping() and session.client.status == "running":
            workers = session.client.scheduler_info(n_workers=-1)["workers"]
            if len(session.away) >= max(1, len(workers)):
                break
            if (future := _send(session, waiting.pop(0))) is not None:
                arriving.add(future)
        if not session.away:
            break
        _receive(session, next(arriving))
    if session.client.status != "running":
        for task in waiting:
            session.arrived([lost(task, run_id, GONE) for run_id in task.run_ids])


def _send(session: _Session, task: Task) -> "Future[Any] | None":
    """Lock the runs of a task and send them to a worker; None if another process has one."""
    from msgdrop_cli.engine.opening import lock

    away = _Away(task)
    parcels: dict[str, Parcel] = {}
    try:
        for run in task.train:
            found = lock(run, task.root, away.locks)
            away.folders[run.run_id] = found.path
            if isinstance(found, Epoch):
                with suppress(RecordError):  # it has none yet
                    set_status(found.path, "running")
            parcels[run.run_id] = parcel(found.path)
    except RecordError as error:
        away.locks.close()
        outcomes = [lost(task, run_id, str(error)) for run_id in task.run_ids]
        session.arrived([replace(each, exit_code=error.exit_code) for each in outcomes])
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that it is large: it goes to one worker only
        future = session.client.submit(
            work_apart, task, parcels, session.name, pure=False, retries=0
        )
    session.away[future] = away
    return future


def _receive(session: _Session, future: "Future[Any]") -> None:
    """Put what came back where it belongs, and say how it ended."""
    with session.guard:
        away = session.away.pop(future)
        with away.locks:
            back = future.result() if future.status == "finished" else None
            outcomes = []
            for outcome, files in back or ():
                folder = away.folders[outcome.run_id]
                try:
                    open_parcel(files, folder)
                    outcomes.append(replace(outcome, path=folder))
                except RecordError as error:
                    failed = lost(away.task, outcome.run_id, str(error))
                    outcomes.append(replace(failed, exit_code=error.exit_code))
            for folder in away.folders.values():
                (folder / PROGRESS).unlink(missing_ok=True)
    session.arrived(outcomes if back is not None else lost_by(future, away.task))


@contextmanager
def _asking(session: _Session) -> Iterator[None]:
    """Workers are asked how far they are, and told whether to stop, while this context lasts."""
    over = threading.Event()

    def ask() -> None:
        number = 0
        # A cluster that is gone is noticed where its work is awaited.
        while not over.wait(_ASK_EVERY_S):
            number += 1
            line = f"{int(session.control.stopping())}{number:08}\n"
            with suppress(Exception):
                said = session.client.run(hear, session.name, line, on_error="ignore")
                for phases, progress in said.values():
                    _show(session, phases, progress)
        with suppress(Exception):
            session.client.run(forget, session.name, on_error="ignore")

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(2 * _ASK_EVERY_S)  # it may wait for a worker that is cut off


def _show(session: _Session, phases: Mapping[str, str], progress: Mapping[str, Any]) -> None:
    """Say here what a worker said there, as one of this machine would have."""
    with session.guard:
        folders = {k: path for each in session.away.values() for k, path in each.folders.items()}
        known = session.control.phases()
        for run_id, phase in phases.items():
            if run_id in folders and known.get(run_id) != phase:
                session.control.mark(run_id, phase)
        for run_id, said in progress.items():
            if run_id in folders:
                write_json_atomic(folders[run_id] / PROGRESS, said, durable=False)
