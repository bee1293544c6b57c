"""Workers that are silent, die too early or are all gone: an end in time, and a line why."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from threading import Thread

import pytest

from msgdrop_cli.cluster import apart, connection, shared, tasks, workers
from msgdrop_cli.cluster.workers import check_workers
from msgdrop_cli.errors import RunError
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.scheduler import run_tasks
from msgdrop_cli.stopping import Control, graceful_stop
from tests.dask_processes import Cluster, running
from tests.processes import children, tasks_for, tiny_runs, wait_for

pytest.importorskip("distributed")
ENDLESS = 4_000_000


@pytest.fixture
def two_workers(tmp_path: Path) -> Iterator[Cluster]:
    """A scheduler and two workers."""
    with running(tmp_path, workers=2) as there:
        yield there


def killed(*victims: subprocess.Popen[bytes]) -> None:
    """Kill -9."""
    for process in victims:
        process.kill()


@pytest.mark.parametrize("way", [shared, apart])
def test_a_cluster_without_workers_is_an_error_and_no_wait(
    way: object, two_workers: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All workers are lost, the scheduler lives: it would wait for others for ever."""
    monkeypatch.setattr(tasks, "PATIENCE_S", 1.0)
    root = tmp_path / "results"
    with connection.connected(two_workers.address) as client, graceful_stop() as control:
        client.wait_for_workers(2, timeout=40)
        killed(*two_workers.workers)
        todo = tasks_for(tiny_runs(seeds=(1, 2, 3)), root)
        outcomes = run_tasks(todo, control, workers=1, elsewhere=way.on(client))  # type: ignore[attr-defined]
    assert {(each.status, each.reason) for each in outcomes} == {("failed", tasks.NOBODY)}


def test_a_silent_worker_is_refused_by_name(
    two_workers: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker was stopped: it would answer no more before its time to live is over."""
    monkeypatch.setattr(workers, "PATIENCE_S", 1.0)
    with connection.connected(two_workers.address) as client:
        client.wait_for_workers(2, timeout=40)
        two_workers.workers[0].send_signal(signal.SIGSTOP)
        with pytest.raises(RunError, match=r"^worker tcp://.*: does not answer .*; end it$"):
            check_workers(client, tmp_path)


@pytest.mark.parametrize("signum", [signal.SIGKILL, signal.SIGSTOP])
def test_a_worker_lost_at_the_start_is_one_line(
    signum: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`local:2` while it begins: no traceback of Dask's, and no wait."""
    monkeypatch.setattr(connection, "_START_S", 1.0)

    def lose() -> None:
        wait_for(lambda: begun(os.getpid()), 60.0)
        os.kill(begun(os.getpid())[0], signum)

    thread = Thread(target=lose)
    thread.start()
    with (
        pytest.raises(RunError, match=r"^local:2: a worker died before it was ready") as caught,
        connection.connected("local:2"),
    ):
        pass
    thread.join()
    assert "\n" not in str(caught.value)
    wait_for(lambda: not begun(os.getpid()), 20.0)


def begun(parent: int) -> list[int]:
    """The worker processes that a process has begun."""

    def words(pid: int) -> bytes:
        try:
            return Path(f"/proc/{pid}/cmdline").read_bytes()
        except OSError:
            return b""

    return [pid for pid in children(parent) if b"spawn_main" in words(pid)]


@pytest.mark.slow
def test_who_is_stopped_keeps_nobody_else_uninformed(two_workers: Cluster, tmp_path: Path) -> None:
    """One of two workers is stopped: the other one still hears the word to stop."""
    root = tmp_path / "results"

    def stop(control: Control) -> None:
        wait_for(lambda: len(list(root.glob("runs/*/*/progress.json"))) == 2, 90.0)
        two_workers.workers[0].send_signal(signal.SIGSTOP)
        (one, other) = root.glob("runs/*/*/progress.json")
        before = one.read_text(), other.read_text()
        wait_for(lambda: (one.read_text(), other.read_text()) != before)
        control.ask()

    def came(outcome: Outcome) -> None:
        killed(*two_workers.workers, two_workers.scheduler)

    with connection.connected(two_workers.address) as client, graceful_stop() as control:
        client.wait_for_workers(2, timeout=40)
        todo = tasks_for(tiny_runs(steps=ENDLESS, seeds=(1, 2)), root)
        thread = Thread(target=stop, args=(control,))
        thread.start()
        outcomes = run_tasks(todo, control, workers=1, finished=came, elsewhere=apart.on(client))
    thread.join()
    assert sorted(each.status for each in outcomes) == ["failed", "interrupted"]


@pytest.mark.slow
def test_a_result_that_is_lost_before_it_is_fetched_is_made_again(
    two_workers: Cluster, tmp_path: Path
) -> None:
    """A worker dies with what it has finished: no failure, another worker does it."""
    root = tmp_path / "results"

    with connection.connected(two_workers.address) as client, graceful_stop() as control:

        def came(outcome: Outcome) -> None:
            """Both have finished: now one of them dies."""
            if two_workers.workers[0].poll() is None:
                wait_for(lambda: not any(client.processing().values()), 60.0)
                killed(two_workers.workers[0])
                wait_for(lambda: len(client.nthreads()) == 1)

        client.wait_for_workers(2, timeout=40)
        todo = tasks_for(tiny_runs(seeds=(1, 2)), root)
        outcomes = run_tasks(todo, control, workers=1, finished=came, elsewhere=apart.on(client))
    assert [each.status for each in outcomes] == ["done"] * 2
