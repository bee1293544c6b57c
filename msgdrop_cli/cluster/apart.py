"""Tasks on workers that do not see the results folder: each run goes there and comes back whole.

The owner holds the locks of the runs that are away, so that nobody else trains them; who is at
what, and how far, is asked about once a second, and the same question carries the word to stop.
Each worker is asked by itself: one that is cut off or stopped must not keep the others uninformed,
who would take the silence for the owner's death.
"""

import secrets
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import wait
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgdrop_cli.cluster.connection import Answer, asked
from msgdrop_cli.cluster.guests import forget, hear, work_apart
from msgdrop_cli.cluster.parcels import Parcel, open_parcel, parcel
from msgdrop_cli.cluster.tasks import carry
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import Epoch, run_lock, write_json_atomic
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.store import PROGRESS, set_status
from msgdrop_cli.scheduler import Arrived, Elsewhere, Task, lost
from msgdrop_cli.stopping import NOTHING, Control

if TYPE_CHECKING:
    from distributed import Client, Future

_FAREWELL_S = 2.0


def on(client: "Client") -> Elsewhere:
    """What does the scheduler's tasks on this cluster (`run_tasks(elsewhere=...)`)."""

    def do(tasks: Sequence[Task], control: Control, arrived: Arrived) -> None:
        with closing(_Apart(client, control)) as way:
            carry(client, way, tasks, control, arrived)

    return do


@dataclass(slots=True)
class _Away:
    """The folders of the runs of a task that a worker has, which are locked here."""

    locks: ExitStack = field(default_factory=ExitStack)
    folders: dict[str, Path] = field(default_factory=dict)
    epochs: dict[str, Epoch] = field(default_factory=dict)


@dataclass(slots=True)
class _Apart:
    """The runs of one command that are away; a task whose worker dies begins as it was sent."""

    client: "Client"
    control: Control
    session: str = field(default_factory=lambda: secrets.token_hex(8))
    away: dict[tuple[str, ...], _Away] = field(default_factory=dict)
    """By the ids of the runs of its task."""
    questions: dict[str, Answer] = field(default_factory=dict)
    """By worker, what it has not answered yet."""
    number: int = 0

    def submit(self, task: Task) -> "Future[Any]":
        """Lock the runs of a task and send them; RecordError if another process has one."""
        from msgdrop_cli.engine.opening import lock

        parcels: dict[str, Parcel] = {}
        with ExitStack() as locks:
            away = _Away()
            for run in task.train:
                found = lock(run, task.root, locks)
                away.folders[run.run_id] = found.path
                if not isinstance(found, Epoch):  # another process has finished it just now
                    found = locks.enter_context(run_lock(found.path))
                else:
                    with suppress(RecordError):  # it has none yet
                        set_status(found.path, "running")
                away.epochs[run.run_id] = found
                parcels[run.run_id] = parcel(found.path)
            away.locks = locks.pop_all()
        self.away[task.run_ids] = away
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # it is large, but goes to one worker only
            return self.client.submit(
                work_apart, task, parcels, self.session, pure=False, retries=0
            )

    def receive(self, task: Task, result: Sequence[tuple[Outcome, Parcel]]) -> list[Outcome]:
        """Put what came back where it belongs, and say how it ended."""
        outcomes, unread = [], dict[str, RecordError]()
        away = self.away[task.run_ids]
        for outcome, files in result:
            folder = away.folders[outcome.run_id]
            try:
                away.epochs[outcome.run_id].check()
                open_parcel(files, folder)
                outcomes.append(replace(outcome, path=folder))
            except RecordError as error:
                unread[outcome.run_id] = error
        self.abandon(task)  # first: the record says what was lost, too, which takes the lock
        for run_id, damage in unread.items():
            failed = lost(task, run_id, str(damage))
            outcomes.append(replace(failed, exit_code=damage.exit_code))
        return outcomes

    def abandon(self, task: Task) -> None:
        """Unlock the runs of a task: nothing more will come back."""
        away = self.away.pop(task.run_ids)
        for run_id in away.folders:
            self.control.mark(run_id, NOTHING)  # nobody waits for what it wrote
        self._unlock(away)

    def look_after(self, workers: Sequence[str]) -> None:
        """Show what workers have said; ask whoever owes no answer, and tell it whether to stop."""
        for address in [each for each, answer in self.questions.items() if answer.done()]:
            with suppress(Exception):  # of a worker that is lost Dask itself will hear
                for phases, progress in self.questions[address].result().values():
                    self._show(phases, progress)
            del self.questions[address]
        self.number += 1
        line = f"{int(self.control.stopping())}{self.number:08}\n"
        for address in set(workers).difference(self.questions):
            self.questions[address] = self._asked([address], hear, line)

    def close(self) -> None:
        """Unlock everything; whoever is still at work on it stops."""
        while self.away:
            self._unlock(self.away.popitem()[1])
        if self.client.status == "running":
            wait([self._asked(None, forget)], _FAREWELL_S)

    def _unlock(self, away: _Away) -> None:
        with away.locks:
            for folder in away.folders.values():
                with suppress(OSError):  # of a drive that fails the record has told
                    (folder / PROGRESS).unlink(missing_ok=True)

    def _asked(self, workers: list[str] | None, what: Callable[..., Any], *words: str) -> Answer:
        options: dict[str, Any] = {"workers": workers, "on_error": "ignore"}
        return asked(self.client, self.client.run, what, self.session, *words, **options)

    def _show(self, phases: Mapping[str, str], progress: Mapping[str, Any]) -> None:
        """Say here what a worker said there, as one of this machine would have."""
        folders = {k: path for each in self.away.values() for k, path in each.folders.items()}
        known = self.control.phases()
        for run_id, phase in phases.items():
            if run_id in folders and known.get(run_id) != phase:
                self.control.mark(run_id, phase)
        for run_id, said in progress.items():
            if run_id in folders:
                write_json_atomic(folders[run_id] / PROGRESS, said, durable=False)
