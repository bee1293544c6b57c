"""Tasks on a real Dask scheduler and three real workers, all of this machine, and their deaths."""

import os
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread

import pytest

from msgdrop_cli.cluster import connection, shared, workers
from msgdrop_cli.cluster.control import SharedControl, shared_control
from msgdrop_cli.cluster.tasks import GONE
from msgdrop_cli.cluster.workers import Workers, check_workers
from msgdrop_cli.engine import facts
from msgdrop_cli.errors import DefinitionError, RunError
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.store import list_runs
from msgdrop_cli.scheduler import run_tasks
from msgdrop_cli.stopping import graceful_stop
from tests.cli_runs import msgdrop
from tests.dask_processes import Cluster, running, worker
from tests.processes import tasks_for, tiny_runs, wait_for
from tests.runs import digest

pytest.importorskip("distributed")
STEPS = 2_000


@pytest.fixture
def three_workers(tmp_path: Path) -> Iterator[Cluster]:
    """A scheduler and three workers."""
    with running(tmp_path, workers=3) as there:
        yield there


def do(there: Cluster, root: Path, steps: int = STEPS) -> list[Outcome]:
    """Three tiny runs on the cluster."""
    with (
        connection.connected(there.address) as client,
        graceful_stop(lambda: shared_control(root)) as control,
    ):
        client.wait_for_workers(3, timeout=40)
        tasks = tasks_for(tiny_runs(steps=steps, seeds=(1, 2, 3)), root)
        return run_tasks(tasks, control, workers=1, elsewhere=shared.on(client))


@contextmanager
def killed_at_work(root: Path, *victims: subprocess.Popen[bytes]) -> Iterator[None]:
    """Kill these processes once all three runs have been begun and none has ended."""

    def kill() -> None:
        wait_for(lambda: len(list(root.glob("runs/*/*/run.json"))) == 3, 90.0)
        words.update(run.status for run in list_runs(root))
        for process in victims:
            process.kill()

    words = set[str]()
    thread = Thread(target=kill)
    thread.start()
    yield
    thread.join()
    assert "done" not in words, "too late"


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What three runs come to in this process."""
    root = tmp_path_factory.mktemp("here")
    with graceful_stop() as control:
        run_tasks(tasks_for(tiny_runs(STEPS, (1, 2, 3)), root), control, workers=1)
    return {run.run_id: digest(run.path) for run in list_runs(root)}


@pytest.mark.slow
def test_a_cluster_gives_the_same(
    three_workers: Cluster, undisturbed: dict[str, str], tmp_path: Path
) -> None:
    """The same logs and policies as in this process, and a record that says where."""
    root = tmp_path / "results"
    root.mkdir()
    outcomes = do(three_workers, root)
    assert [each.status for each in outcomes] == ["done"] * 3
    runs = list_runs(root)
    assert {run.run_id: digest(run.path) for run in runs} == undisturbed
    assert {run.run["node"] for run in runs} == {os.uname().nodename}
    assert sorted(entry.name for entry in root.iterdir()) == ["runs"]  # no control is left


@pytest.mark.slow
def test_the_run_of_a_killed_worker_goes_on_elsewhere(
    three_workers: Cluster, undisturbed: dict[str, str], tmp_path: Path
) -> None:
    """Two of three workers die with a run each; the third does all of them."""
    root = tmp_path / "results"
    root.mkdir()
    with killed_at_work(root, *three_workers.workers[:2]):
        outcomes = do(three_workers, root)
    assert [each.status for each in outcomes] == ["done"] * 3
    assert {run.run_id: digest(run.path) for run in list_runs(root)} == undisturbed


@pytest.mark.slow
def test_a_lost_scheduler_is_an_error_and_no_wait(three_workers: Cluster, tmp_path: Path) -> None:
    """What did not arrive has failed, and says why; it goes on when it is asked for again."""
    root = tmp_path / "results"
    root.mkdir()
    with killed_at_work(root, three_workers.scheduler):
        outcomes = do(three_workers, root, steps=4_000_000)
    assert {each.status for each in outcomes} == {"failed"}
    assert {each.reason for each in outcomes} == {GONE}


def test_workers_hear_the_stop_and_the_silence(tmp_path: Path) -> None:
    """A request reaches who opens the file; a command that was killed says nothing any more."""
    with shared_control(tmp_path) as control:
        assert isinstance(control, SharedControl)
        assert not control.stopping()
        control.ask()
        assert control.stopping()
        control.ask(False)
        assert not control.stopping()
        control.since -= 121.0
        assert control.stopping()  # the number has not changed since
        control.beat(7)
        assert not control.stopping()
    assert control.stopping()  # it has ended


def test_whoever_has_heard_nothing_yet_has_not_waited(tmp_path: Path) -> None:
    """A control in which nothing stands yet is no silence of two minutes: the work begins."""
    (tmp_path / "control").touch()
    assert not SharedControl(tmp_path / "control", -1).stopping()


def test_workers_that_could_not_do_it_are_refused(three_workers: Cluster, tmp_path: Path) -> None:
    """Two tasks at once, or other code than ours: a line that names the worker."""
    with connection.connected(three_workers.address) as client:
        client.wait_for_workers(3, timeout=40)
        assert check_workers(client, tmp_path) == Workers("3 workers on 1 machine", share=True)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(facts, "commit", lambda: "f" * 40)
            with pytest.raises(
                RunError, match=r"^worker tcp://.*: .* commit .*, not ffffffffffff$"
            ):
                check_workers(client, tmp_path)
            patch.undo()
            patch.setattr(workers, "__version__", "9.9")
            with pytest.raises(RunError, match=r"^worker tcp://.*: has msgdrop 0.*, not 9\.9$"):
                check_workers(client, tmp_path)
            patch.undo()
            patch.setattr(facts, "versions", lambda: {"torch": "9.9"})
            (note, *_) = check_workers(client, tmp_path).notes
            assert re.search(r"^worker tcp://.*: torch .*, here 9\.9: last bits may differ$", note)
        extra = worker(tmp_path, three_workers.address.replace("dask", "tcp"), threads=2)
        try:
            client.wait_for_workers(4, timeout=40)
            with pytest.raises(RunError, match="start it with --nthreads 1"):
                check_workers(client, tmp_path)
        finally:
            extra.kill()
            extra.wait()


@pytest.mark.parametrize("where", ["local:0", "local:x", "dask://host", "http://a:1", "local:999"])
def test_only_clusters_are_asked(where: str) -> None:
    """Two words for what can be meant, before anything is loaded."""
    with pytest.raises(DefinitionError, match="expected dask://HOST:PORT"):
        connection.check_cluster(where)
    said = msgdrop("ablate", "broken-links", "--cluster", where)
    assert said.code == 2


def test_nobody_there_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """An address without a scheduler ends in an error soon."""
    monkeypatch.setattr(connection, "PATIENCE_S", 0.5)
    nobody = pytest.raises(RunError, match=r"^dask://127\.0\.0\.1:9: no scheduler answers there: ")
    with nobody, connection.connected("dask://127.0.0.1:9"):
        pass


def test_certificates_are_three_files(tmp_path: Path) -> None:
    """CA, certificate and key, all of them there."""
    with pytest.raises(DefinitionError, match="expected three files"):
        connection.check_tls("a,b")
    with pytest.raises(DefinitionError, match="a: there is no such file"):
        connection.check_tls(f"{tmp_path}/a,b,c")
