"""Work that is asked to stop: checkpoints, patience, and the end; most of it in real processes."""

import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from msgdrop_cli import scheduler, stopping
from msgdrop_cli.engine import run as run_module
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.scheduler import Task, run_tasks
from msgdrop_cli.signals import SIGNALS
from msgdrop_cli.stopping import Control, graceful_stop
from tests.cli_runs import ROOT
from tests.processes import (
    TINY,
    alive,
    children,
    tasks_for,
    tiny_runs,
    wait_for,
    words_of,
    workers_of,
)

Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts `msgdrop train` on runs that would take hours, and cleans up after the test."""
    begun: list[subprocess.Popen[str]] = []
    temporary = tmp_path / "temporary"
    temporary.mkdir()

    def begin(workers: int) -> "subprocess.Popen[str]":
        sets = [
            part for each in (*TINY, "training.train_env_steps=5000000") for part in ("--set", each)
        ]
        command = ["train", "--seeds", "2", "--workers", str(workers), "--results", str(tmp_path)]
        paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
        process = subprocess.Popen(
            [sys.executable, "-m", "msgdrop_cli", *command, *sets],
            env={**os.environ, "PYTHONPATH": paths, "TMPDIR": str(temporary)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        begun.append(process)
        return process

    yield begin
    for process in begun:
        process.kill()
        process.communicate()


def test_handlers_are_put_back() -> None:
    """Signals mean afterwards what they meant before."""
    before = signal.getsignal(signal.SIGTERM)
    with graceful_stop():
        assert signal.getsignal(signal.SIGTERM) is not before
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize(
    ("workers", "signum", "code"), [(2, signal.SIGINT, 130), (1, signal.SIGTERM, 143)]
)
def test_a_signal_stops_with_checkpoints(
    start: Start, tmp_path: Path, workers: int, signum: signal.Signals, code: int
) -> None:
    """Everything is checkpointed and the way to go on is said (10 s on a machine that is idle).

    Also if somebody has cleaned away what lay in the temporary folder, as systemd does.
    """
    process = start(workers)
    wait_for(lambda: len(list(tmp_path.rglob("progress.json"))) == workers)
    shutil.rmtree(tmp_path / "temporary")
    os.killpg(process.pid, signum)  # a terminal sends it to the workers, too
    _, err = process.communicate(timeout=60)
    assert process.returncode == code, err
    assert "stopping: writing checkpoints" in err
    assert "the same command goes on:\n  msgdrop train" in err
    assert words_of(tmp_path) == ["interrupted"] * workers + ["planned"] * (2 - workers)
    assert len(list(tmp_path.rglob("MANIFEST.json"))) >= workers


def test_the_second_signal_ends_at_once(start: Start, tmp_path: Path) -> None:
    """Whoever asks twice does not wait for checkpoints (1 s on a machine that is idle)."""
    process = start(1)
    wait_for(lambda: list(tmp_path.rglob("progress.json")))
    process.send_signal(signal.SIGSTOP)  # so that both are there when it wakes up
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGTERM)
    process.send_signal(signal.SIGCONT)
    process.wait(timeout=20)
    assert not list(tmp_path.rglob("MANIFEST.json"))
    assert process.returncode in (130, 143)


def test_kill_9_of_the_parent_leaves_nothing(start: Start, tmp_path: Path) -> None:
    """Workers die with the process that started them, however it ends; no file says stop."""
    process = start(2)
    wait_for(lambda: len(list(tmp_path.rglob("progress.json"))) == 2)
    workers = children(process.pid)
    assert len(workers) >= 2
    process.kill()
    wait_for(lambda: not any(map(alive, workers)))
    assert not list((tmp_path / "temporary").glob("msgdrop*"))


def when_at_work(root: Path, runs: int, then: Callable[[], None]) -> threading.Thread:
    """Do something, in a thread, as soon as so many runs train."""

    def watch() -> None:
        wait_for(lambda: len(list(root.rglob("progress.json"))) == runs)
        then()

    thread = threading.Thread(target=watch)
    thread.start()
    return thread


def test_a_stopped_worker_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who answers is interrupted with a checkpoint, who does not without; nobody stays running."""
    monkeypatch.setattr(stopping, "PATIENCE_S", 4.0)

    def freeze_one() -> None:
        os.kill(workers_of(os.getpid())[0], signal.SIGSTOP)
        os.kill(os.getpid(), signal.SIGINT)

    runs = tiny_runs(steps=5_000_000)
    with graceful_stop() as control:
        thread = when_at_work(tmp_path, 2, freeze_one)
        outcomes = run_tasks(tasks_for(runs, tmp_path), control, workers=2)
        thread.join()
    assert control.signal == signal.SIGINT
    assert [outcome.status for outcome in outcomes] == ["interrupted"] * 2
    assert sorted(outcome.reason is None for outcome in outcomes) == [False, True]
    assert words_of(tmp_path) == ["interrupted"] * 2
    assert not workers_of(os.getpid())


def in_this_process(
    work: Callable[[Control], None], monkeypatch: pytest.MonkeyPatch, root: Path
) -> Outcome:
    """One task that does `work` after a first Ctrl-C, under little patience."""

    def train(task: Task, control: Control) -> list[Outcome]:
        signal.raise_signal(signal.SIGINT)
        work(control)
        return [Outcome(run_id=task.run_ids[0], path=root, status="interrupted", env_steps=7)]

    monkeypatch.setattr(scheduler, "_train", train)
    monkeypatch.setattr(stopping, "PATIENCE_S", 0.1)
    monkeypatch.setattr(stopping, "LOOK_AGAIN_S", 0.1)
    with graceful_stop() as control:
        [outcome] = run_tasks(tasks_for(tiny_runs(seeds=(1,)), root), control, workers=1)
    return outcome


def test_work_that_hangs_here_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where no worker stands between."""

    def hang(_: Control) -> None:
        threading.Event().wait(60)

    outcome = in_this_process(hang, monkeypatch, tmp_path)
    assert (outcome.status, outcome.env_steps) == ("interrupted", 0)
    assert "without a checkpoint" in str(outcome.reason)


def test_whoever_writes_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A checkpoint that takes long is worth more than the patience."""
    looks: list[bool] = []

    def write(control: Control) -> None:
        def writing(_: Control) -> bool:
            looks.append(control.given_up)
            return True

        monkeypatch.setattr(Control, "writing", writing)
        wait_for(lambda: len(looks) > 2)

    assert in_this_process(write, monkeypatch, tmp_path).env_steps == 7


def test_a_run_that_heeds_the_stop_says_that_it_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the moment that it looks until its outcome is there."""
    seen: list[bool] = []
    [run] = tiny_runs(seeds=(1,))

    def train(*_: object, stop: Callable[[], bool], **__: object) -> list[Outcome]:
        for _each in range(2):
            seen.extend([stop(), control.writing()])
            control.ask()
        return [Outcome(run_id=run.run_id, path=tmp_path, status="interrupted")]

    monkeypatch.setattr(run_module, "train_cohort", train)
    with graceful_stop() as control:
        run_tasks(tasks_for([run], tmp_path), control, workers=1)
        assert seen == [False, False, True, True]
        assert not control.writing()


def test_workers_never_get_a_signal(tmp_path: Path) -> None:
    """They are held back from a worker's first moment: until it ignores them is too late."""
    held: list[int] = []

    def look(_: Outcome) -> None:
        for pid in workers_of(os.getpid()):
            facts = dict(
                line.split(":\t", 1)
                for line in Path(f"/proc/{pid}/status").read_text().splitlines()
            )
            held.append(int(facts["SigBlk"], 16))

    with graceful_stop() as control:
        run_tasks(tasks_for(tiny_runs(), tmp_path), control, workers=2, finished=look)
    assert held
    assert all(mask >> (each - 1) & 1 for mask in held for each in SIGNALS)
