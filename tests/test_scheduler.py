"""Tasks on workers and in this process: the same results, and workers that die."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli import scheduler
from msgdrop_cli.engine import evaluation
from msgdrop_cli.engine import run as run_module
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.scheduler import run_tasks
from msgdrop_cli.stopping import Control, graceful_stop
from tests.processes import tasks_for, tiny_runs, words_of, workers_of
from tests.runs import digest

Arrived = Callable[[Sequence[Outcome]], None]


def test_workers_and_this_process_give_the_same(tmp_path: Path) -> None:
    """Two workers and none, in any order: the same logs, episodes and policies of every run."""
    runs = tiny_runs(seeds=(1, 2, 3))
    found: list[dict[str, tuple[str, bytes]]] = []
    for workers, order in ((1, (0, 1, 2)), (2, (2, 0, 1)), (1, (1, 2, 0))):
        asked = [runs[number] for number in order]
        with graceful_stop() as control:
            root = tmp_path / str(len(found))
            outcomes = run_tasks(tasks_for(asked, root), control, workers=workers)
        assert [(each.run_id, each.status) for each in outcomes] == [
            (run.run_id, "done") for run in asked
        ]
        paths = {each.run_id: each.path for each in outcomes if each.path is not None}
        found.append(
            {
                run_id: (digest(path), (path / "episodes.jsonl").read_bytes())
                for run_id, path in paths.items()
            }
        )
    assert len(set(found[0].values())) == len(runs)
    assert found[0] == found[1] == found[2]


def test_a_killed_worker_is_replaced(tmp_path: Path) -> None:
    """A worker that dies takes its run along only until it is resubmitted."""
    killed: list[int] = []

    def kill_one(outcome: Outcome) -> None:
        if not killed:
            killed.append(workers_of(os.getpid())[0])
            os.kill(killed[0], signal.SIGKILL)

    # The third run keeps the pool busy when the first is done and a worker is killed.
    runs = (*tiny_runs(), *tiny_runs(steps=800, seeds=(3, 4)))
    with graceful_stop() as control:
        outcomes = run_tasks(tasks_for(runs, tmp_path), control, workers=2, finished=kill_one)
    assert killed
    assert [outcome.status for outcome in outcomes] == ["done"] * 4


def test_a_run_that_kills_its_workers_fails_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three deaths make a run failed; the neighbours that died with it are done."""
    runs = tiny_runs(seeds=(1, 2, 3))
    deadly = runs[0].run_id
    pools = []

    def pool(
        batch: Sequence[scheduler._Attempt], control: Control, workers: int, arrived: Arrived
    ) -> tuple[list[scheduler._Attempt], list[scheduler._Attempt]]:
        ids = [attempt.task.run_ids[0] for attempt in batch]
        pools.append(len(ids))
        if deadly in ids:
            return [], list(batch[:workers])
        arrived([Outcome(run_id=run_id, path=tmp_path, status="done") for run_id in ids])
        return list(batch), []

    monkeypatch.setattr(scheduler, "_one_pool", pool)
    with graceful_stop() as control:
        outcomes = run_tasks(tasks_for(runs, tmp_path), control, workers=2)
    assert [outcome.status for outcome in outcomes] == ["failed", "done", "done"]
    assert "died 3 times" in str(outcomes[0].reason)
    assert outcomes[0].exit_code == 3


def test_nothing_begins_after_a_stop(tmp_path: Path) -> None:
    """After a request to stop every run still has its outcome, and none was begun."""
    for workers in (1, 2):
        with graceful_stop() as control:
            control.ask()
            outcomes = run_tasks(tasks_for(tiny_runs(), tmp_path), control, workers=workers)
        assert [outcome.status for outcome in outcomes] == ["interrupted"] * 2
    assert list(tmp_path.iterdir()) == []


def test_a_worker_asked_to_stop_loads_nothing() -> None:
    """A task that arrives after the request to stop is given back before torch is loaded."""
    program = (
        "import sys; from pathlib import Path\n"
        f"sys.path[:0] = {sys.path!r}\n"
        "from msgdrop_cli.scheduler import Task, work\n"
        "from msgdrop_cli.stopping import graceful_stop\n"
        "from msgdrop_cli.records.store import RunRecord\n"
        "run = RunRecord(Path(), {'run_id': 'a', 'env_steps': 0})\n"
        "task = Task(root=Path(), trained=(run,), channels=(), episodes=1, device='cpu')\n"
        "with graceful_stop() as control:\n"
        "    control.ask()\n"
        "    print(work(task, control)[0].status, 'torch' in sys.modules)\n"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == "interrupted False\n", done.stderr


def test_a_stop_after_training_leaves_the_evaluation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever is asked to stop when the training is done does not begin to evaluate."""
    train = run_module.train_cohort

    def stop_then(*arguments: Any, **options: Any) -> list[Outcome]:
        outcomes = train(*arguments, **options)
        control.ask()
        return outcomes

    monkeypatch.setattr(run_module, "train_cohort", stop_then)
    monkeypatch.setattr(evaluation, "evaluate_run", lambda *_, **__: pytest.fail("evaluated"))
    with graceful_stop() as control:
        outcomes = run_tasks(tasks_for(tiny_runs(seeds=(1,)), tmp_path), control, workers=1)
    assert [outcome.status for outcome in outcomes] == ["interrupted"]
    assert words_of(tmp_path) == ["done"]


def test_a_full_disk_in_training_is_74(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The code of a fault of the disk goes from the run to the command, not 3."""

    def full(path: Path, *rows: object, durable: bool) -> None:
        raise RecordError(f"{path}: cannot be written: No space left on device", 74)

    monkeypatch.setattr(run_module, "append_jsonl", full)
    with graceful_stop() as control:
        outcomes = run_tasks(tasks_for(tiny_runs(seeds=(1,)), tmp_path), control, workers=1)
    assert [(outcome.status, outcome.exit_code) for outcome in outcomes] == [("failed", 74)]
