"""Cohorts to outcomes: what is to be done, on joblib workers that survive, stop and die cleanly.

* A worker dies with this process, however it ends, and leaves all signals to it.
* Whoever is asked to stop (`stopping.py`) writes checkpoints and returns, or is given up.
* A worker that dies breaks joblib's whole pool: what is unfinished is submitted again.
"""

import ctypes
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import MsgdropError, RecordError
from msgdrop_cli.records.files import run_lock
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.run_file import Status
from msgdrop_cli.records.store import RUNS, RunRecord, find_run, run_path, set_status
from msgdrop_cli.signals import SIGNALS, held_back
from msgdrop_cli.stopping import NOTHING, WRITING, Control, Unanswered

TRIES = 3
"""How often a run is begun or continued if its worker dies."""
_PR_SET_PDEATHSIG = 1
Arrived = Callable[[Sequence[Outcome]], None]
"""Is called with the outcomes of a task."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What one worker does in one go: train a cohort, or take trained runs; then evaluate them."""

    root: Path
    train: tuple[PlannedRun, ...] = ()
    trained: tuple[RunRecord, ...] = ()
    channels: tuple[Channel, ...]
    """One evaluation through each."""
    episodes: int
    device: str

    @property
    def run_ids(self) -> tuple[str, ...]:
        """One outcome is owed for each of these."""
        return tuple(self.folders)

    @property
    def folders(self) -> dict[str, Path]:
        """By run id, where its run is or will be."""
        new = {run.run_id: run_path(self.root, run) for run in self.train}
        return new | {record.run_id: record.path for record in self.trained}


Elsewhere = Callable[[Sequence[Task], Control, Arrived], None]
"""Does tasks and says what arrives of them, as `_in_pool` does."""


def run_tasks(
    tasks: Sequence[Task],
    control: Control,
    *,
    workers: int,
    finished: Callable[[Outcome], None] = lambda outcome: None,
    elsewhere: Elsewhere | None = None,
) -> list[Outcome]:
    """Do all tasks; returns one outcome for each of their runs, in the order of the tasks.

    `finished` is called with each outcome as it arrives. One worker, or one task, is done in
    this process. After a request to stop, what was not begun is `interrupted`.
    elsewhere: what does the tasks instead of `workers` processes of this machine.
    """
    outcomes: dict[str, Outcome] = {}

    def arrived(news: Sequence[Outcome]) -> None:
        for outcome in news:
            outcomes[outcome.run_id] = outcome
            finished(outcome)

    control.waiting = True
    try:
        if elsewhere is not None:
            elsewhere(tasks, control, arrived)
        elif min(workers, len(tasks)) <= 1:
            for task in tasks:
                if not control.stopping():
                    arrived(work(task, control))
        else:
            _in_pool(list(tasks), control, workers, arrived)
    except Unanswered:
        pass  # joblib has killed the silent ones by now
    finally:
        control.waiting = False
    begun = control.phases()
    for task in tasks:
        for run_id in task.run_ids:
            if run_id not in outcomes:
                ended = _given_up if run_id in begun else _interrupted
                arrived([ended(task, run_id)])
    return [outcomes[run_id] for task in tasks for run_id in task.run_ids]


def work(task: Task, control: Control) -> list[Outcome]:
    """Train and evaluate; every error becomes the outcome of the runs that it hit."""
    if control.stopping():  # before anything heavy is loaded
        return [_interrupted(task, run_id) for run_id in task.run_ids]
    outcomes = [
        Outcome(run_id=record.run_id, path=record.path, status="done", env_steps=record.env_steps)
        for record in task.trained
    ]
    if task.train:
        for run in task.train:
            control.mark(run.run_id, "training")
        try:
            outcomes += _train(task, control)
        except Exception as error:
            outcomes += [_failure(task, run.run_id, error) for run in task.train]
    outcomes = [_evaluated(task, outcome, control) for outcome in outcomes]
    for run_id in task.run_ids:
        control.mark(run_id, NOTHING)
    return outcomes


@dataclass(slots=True, eq=False)
class _Attempt:
    task: Task
    tries: int = 0


def _in_pool(tasks: list[Task], control: Control, workers: int, arrived: Arrived) -> None:
    """Do the tasks on worker processes, anew while a worker dies on the way.

    Nobody knows which task killed it: each one's last try is alone, so none pays for another.
    """
    waiting = [_Attempt(task) for task in tasks]
    while waiting and not control.stopping():
        last = [each for each in waiting if each.tries == TRIES - 1]
        batch = last[:1] if len(last) == len(waiting) else [e for e in waiting if e not in last]
        done, lost = _one_pool(batch, control, workers, arrived)
        for attempt in lost:
            attempt.tries += 1
            if attempt.tries == TRIES and not control.stopping():
                arrived([_killed(attempt.task, run_id) for run_id in attempt.task.run_ids])
        waiting = [e for e in waiting if e not in done and e.tries < TRIES]


def _one_pool(
    batch: Sequence[_Attempt], control: Control, workers: int, arrived: Arrived
) -> tuple[list[_Attempt], list[_Attempt]]:
    """Run a batch until it is done or a worker dies: what is done, and what was in flight then."""
    from multiprocessing import resource_tracker

    from joblib import Parallel, delayed, parallel_config
    from joblib.externals.loky.backend import resource_tracker as loky_tracker
    from joblib.externals.loky.process_executor import BrokenProcessPool

    owner = {run_id: attempt for attempt in batch for run_id in attempt.task.run_ids}
    begun: list[_Attempt] = []
    done: list[_Attempt] = []

    def calls() -> Iterator[object]:
        for attempt in batch:
            if control.stopping():
                return
            begun.append(attempt)
            yield delayed(work)(attempt.task, control)

    try:
        start = {"initializer": _begin_worker, "initargs": (os.getpid(), _wishes())}
        with parallel_config("loky", inner_max_num_threads=1, **start):
            pool = Parallel(
                n_jobs=max(2, min(workers, len(batch))),  # 1 would be this process
                return_as="generator_unordered",
                pre_dispatch="n_jobs",
                batch_size=1,
                temp_folder=batch[0].task.root,  # for large arrays: there are none, it stays empty
            )
            with held_back():
                # They hold back signals themselves, one lets them through afterwards.
                resource_tracker.ensure_running()
                loky_tracker.ensure_running()
            with held_back():
                arriving = pool(calls())
            for outcomes in arriving:
                done.append(owner[outcomes[0].run_id])
                arrived(outcomes)
    except BrokenProcessPool:
        return done, [attempt for attempt in begun or batch if attempt not in done]
    return done, []


def _wishes() -> dict[str, str]:
    """What the user has said by MSGDROP_ variables; workers of other wishes are not taken again."""
    return {name: said for name, said in os.environ.items() if name.startswith("MSGDROP_")}


def _begin_worker(parent: int, wishes: dict[str, str]) -> None:
    """Tie this process to its parent's life, leave the signals to it, and know its wishes."""
    os.environ.update(wishes)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:  # it died before we could ask
        os._exit(1)
    for each in SIGNALS:  # so far they were held back
        signal.signal(each, signal.SIG_IGN)


def _train(task: Task, control: Control) -> list[Outcome]:
    from msgdrop_cli.engine.run import train_cohort

    ids = [run.run_id for run in task.train]

    def stop() -> bool:
        if not control.stopping():
            return False
        for run_id in ids:
            control.mark(run_id, WRITING)
        return True

    if control.stopping():  # while torch was loaded
        return [_interrupted(task, run_id) for run_id in ids]
    return train_cohort(task.train, task.root, device=task.device, stop=stop)


def _evaluated(task: Task, outcome: Outcome, control: Control) -> Outcome:
    """The outcome after the evaluations of a run that is trained; any other stays as it is."""
    if outcome.status != "done":
        return outcome
    if control.stopping():
        return replace(outcome, status="interrupted")
    from msgdrop_cli.engine.evaluation import evaluate_run

    for channel in task.channels:
        control.mark(outcome.run_id, f"evaluating {one_line(channel.short)}")
        try:
            evaluate_run(
                outcome.path,
                channel=channel,
                episodes=task.episodes,
                device=task.device,
                stop=control.stopping,
            )
        except Exception as error:
            what, code = f"{outcome.path}: {type(error).__name__}: {error}", 3
            if isinstance(error, RecordError):  # it names its file
                what, code = str(error), error.exit_code
            reason = f"evaluation: {what}"
            return replace(outcome, status="failed", reason=reason, exit_code=code)
        if control.stopping():
            return replace(outcome, status="interrupted")
    return outcome


def _failure(task: Task, run_id: str, error: Exception) -> Outcome:
    ours = error.exit_code if isinstance(error, MsgdropError) else 0
    reason = str(error) if ours else f"{type(error).__name__}: {error}"
    code = ours if ours >= 64 else 3
    return replace(_ended(task, run_id, "failed", reason), exit_code=code)


def _killed(task: Task, run_id: str) -> Outcome:
    """The outcome of a run that took its workers along."""
    return lost(task, run_id, f"its worker process died {TRIES} times (killed, or out of memory?)")


def lost(task: Task, run_id: str, reason: str) -> Outcome:
    """The outcome of a run of which nothing is heard any more, which its record says, too."""
    _write_down(task, run_id, "failed", reason)
    return replace(_ended(task, run_id, "failed", reason), exit_code=3)


def _given_up(task: Task, run_id: str) -> Outcome:
    """The outcome of a run whose worker did not come back when it was asked to stop."""
    reason = "no answer: ended without a checkpoint"
    _write_down(task, run_id, "interrupted", reason)
    return _ended(task, run_id, "interrupted", reason)


def _interrupted(task: Task, run_id: str) -> Outcome:
    """The outcome of a run that was not begun."""
    return _ended(task, run_id, "interrupted")


def _ended(task: Task, run_id: str, status: Status, reason: str | None = None) -> Outcome:
    return Outcome(run_id=run_id, path=task.folders[run_id], status=status, reason=reason)


def _write_down(task: Task, run_id: str, status: Status, reason: str) -> None:
    """Write down how a run ended whose worker is gone, if it was begun."""
    with suppress(RecordError):  # another process may train it by now
        record = find_run(task.root / RUNS if task.train else task.root, run_id)
        if record is not None and record.status not in ("done", "diverged"):
            with run_lock(record.path):
                set_status(record.path, status, reason)
