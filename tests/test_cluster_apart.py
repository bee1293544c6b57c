"""Runs that travel: workers that see no results folder, and what comes back from them."""

import os
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Thread

import pytest

from msgdrop_cli.cluster import apart, connection, guests
from msgdrop_cli.cluster.control import SILENT
from msgdrop_cli.cluster.parcels import open_parcel, parcel
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import run_lock
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.own_sums import RUN_SUMS
from msgdrop_cli.records.store import list_runs, run_path
from msgdrop_cli.scheduler import run_tasks
from msgdrop_cli.stopping import Control, graceful_stop
from tests.dask_processes import Cluster, running
from tests.processes import tasks_for, tiny_runs, wait_for
from tests.runs import digest

pytest.importorskip("distributed")
SECONDS = 4.0
"""What a run takes: long enough to be stopped on its way."""


@pytest.fixture(scope="module")
def there(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A scheduler and two workers."""
    with running(tmp_path_factory.mktemp("dask"), workers=2) as cluster:
        yield cluster


def do(there: Cluster, root: Path, steps: int, *, stopped: bool = False) -> list[Outcome]:
    """Two tiny runs as if the workers saw nothing of `root`; perhaps stopped on the way."""

    def stop(control: Control) -> None:
        wait_for(lambda: len(control.phases()) == 2, 90.0)
        control.ask()

    with connection.connected(there.address) as client, graceful_stop() as control:
        client.wait_for_workers(2, timeout=40)
        tasks = tasks_for(tiny_runs(steps=steps, seeds=(1, 2)), root)
        if stopped:
            Thread(target=stop, args=(control,)).start()
        return run_tasks(tasks, control, workers=1, elsewhere=apart.on(client))


def digests(root: Path) -> dict[str, str]:
    """By run id, what all runs in a results folder came to."""
    return {run.run_id: digest(run.path) for run in list_runs(root)}


def do_here(root: Path, steps: int) -> None:
    """The same two runs in this process."""
    with graceful_stop() as control:
        run_tasks(tasks_for(tiny_runs(steps, (1, 2)), root), control, workers=1)


def steps_in(seconds: float, scratch: Path) -> int:
    """Env steps of a tiny run that takes so long here: machines differ by five times."""
    do_here(scratch, 1_000)
    quickest = min(float(run.run["wall_time_s"]) for run in list_runs(scratch))
    return 200 * round(5.0 * seconds / quickest)


@pytest.mark.slow
def test_runs_that_travel_are_the_same(there: Cluster, tmp_path: Path) -> None:
    """Stopped, they come home with their checkpoints, and go on from there: one digest."""
    undisturbed, root = tmp_path / "here", tmp_path / "results"
    steps = steps_in(SECONDS, tmp_path / "scratch")
    do_here(undisturbed, steps)
    root.mkdir()
    assert {each.status for each in do(there, root, steps, stopped=True)} == {"interrupted"}
    assert len(list(root.rglob("state.safetensors"))) >= 1
    outcomes = do(there, root, steps)
    assert [each.status for each in outcomes] == ["done"] * 2
    assert digests(root) == digests(undisturbed)
    assert {run.run["node"] for run in list_runs(root)} == {os.uname().nodename}
    names = {path.name for path in root.rglob("*") if path.is_file()}
    kept = {"run.json", "metrics.jsonl", "episodes.jsonl", "policy.safetensors", "lock"}
    assert names == {*kept, RUN_SUMS}  # no checkpoint and no progress is left


def test_a_parcel_becomes_what_it_was(tmp_path: Path) -> None:
    """Checkpoints and all; what was here and did not come is gone, but nobody else's files."""
    (run,) = tiny_runs(seeds=(1,))
    there, here = run_path(tmp_path / "there", run), run_path(tmp_path / "here", run)
    new, old = f"checkpoints/{200:015}/MANIFEST.json", f"checkpoints/{100:015}/MANIFEST.json"
    for folder, names in ((there, ("run.json", new)), (here, (old, "note.txt"))):
        for name in names:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(name)
    with run_lock(there), run_lock(here):
        sent = parcel(there)
        assert sent == {name: name.encode() for name in ("run.json", new)}
        open_parcel(sent, here)
        assert parcel(here) == dict(sent) | {"note.txt": b"note.txt"}


@pytest.mark.parametrize(
    "name",
    ["../run.json", "/nowhere/x", "a/b", "lock", ".tmp-1", "checkpoints/replay/../../x", "a\nb"],
)
def test_nothing_but_a_runs_files_comes(name: str, tmp_path: Path) -> None:
    """A name that leads elsewhere is refused before anything is written."""
    with pytest.raises(RecordError, match=r"came, which is no file of a run$"):
        open_parcel({"run.json": b"{}", name: b"x"}, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_task_and_the_first_word_find_one_control(tmp_path: Path) -> None:
    """They come to two threads of a worker: who is second waits until something stands there."""
    written = Path.write_text

    def slowly(path: Path, text: str) -> int:
        path.touch()
        time.sleep(0.2)
        return written(path, text)

    class Home:
        local_directory = tmp_path

    found: list[str] = []

    def look() -> None:
        home = guests._home(Home(), "session")  # type: ignore[arg-type]
        found.append((home / "control").read_text())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "write_text", slowly)
        threads = [Thread(target=look) for _ in range(2)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
    assert found == [SILENT] * 2
