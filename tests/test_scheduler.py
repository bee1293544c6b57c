"""Workers that die, signals, and the parent's end; most of it in real processes."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli import scheduler
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine import evaluation
from msgdrop_cli.engine import run as run_module
from msgdrop_cli.engine.catalogue import catalogue
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import read_json
from msgdrop_cli.scheduler import Control, Outcome, Task, graceful_stop, run_tasks
from tests.runs import digest

ROOT = Path(__file__).resolve().parents[1]
TINY = (
    *("training.games=4", "training.log_every_env_steps=50", "environment.time_limit=40"),
    *("algorithm.replay_capacity=400", "algorithm.replay_start_env_steps=100"),
)
Arrived = Callable[[Sequence[Outcome]], None]


def tiny_runs(steps: int = 200, seeds: Sequence[int] = (1, 2)) -> tuple[PlannedRun, ...]:
    """Runs of DCC that take a moment each."""
    asked = plan(
        load_definition("blockwise-vs-elementwise"),
        "quick",
        catalogue(),
        overrides=(*TINY, f"training.train_env_steps={steps}"),
        seeds=seeds,
    )
    return tuple(run for run in asked.runs if run.variant == "dcc")


def tasks_for(runs: Sequence[PlannedRun], root: Path) -> list[Task]:
    """One task a run, evaluated in 4 episodes."""
    return [
        Task(root=root, train=(run,), broken_links=(0.0,), episodes=4, device="cpu") for run in runs
    ]


def wait_for(what: Callable[[], object], seconds: float = 40.0) -> None:
    """Wait until something is so."""
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def children(parent: int) -> list[int]:
    """The processes that this process started and that are alive."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                state, ppid = (entry / "stat").read_text().rsplit(")", 1)[1].split()[:2]
            except OSError:
                continue
            if int(ppid) == parent and state != "Z":
                found.append(int(entry.name))
    return found


def alive(pid: int) -> bool:
    """Whether a process runs (a zombie does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts `msgdrop train` on runs that would take hours, and cleans up after the test."""
    begun: list[subprocess.Popen[str]] = []

    def begin(workers: int) -> "subprocess.Popen[str]":
        sets = [
            part
            for each in (*TINY, "training.train_env_steps=90000000")
            for part in ("--set", each)
        ]
        command = ["train", "--seeds", "2", "--workers", str(workers), "--results", str(tmp_path)]
        paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
        process = subprocess.Popen(
            [sys.executable, "-m", "msgdrop_cli", *command, *sets],
            env={**os.environ, "PYTHONPATH": paths},
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


def words_of(root: Path) -> list[str]:
    """The status words of all runs."""
    return sorted(read_json(path)["status"] for path in root.rglob("run.json"))


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
            workers = [
                pid
                for pid in children(os.getpid())
                if "popen_loky" in Path(f"/proc/{pid}/cmdline").read_text()
            ]
            killed.append(workers[0])
            os.kill(workers[0], signal.SIGKILL)

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
        arrived([Outcome(run_id=run_id, path=None, status="done") for run_id in ids])
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
            (control.folder / "stop").touch()
            outcomes = run_tasks(tasks_for(tiny_runs(), tmp_path), control, workers=workers)
        assert [outcome.status for outcome in outcomes] == ["interrupted"] * 2
    assert list(tmp_path.iterdir()) == []


def test_a_worker_asked_to_stop_loads_nothing(tmp_path: Path) -> None:
    """A task that arrives after the request to stop is given back before torch is loaded."""
    program = (
        "import sys; from pathlib import Path\n"
        f"sys.path[:0] = {sys.path!r}\n"
        "from msgdrop_cli.scheduler import Control, Task, work\n"
        "from msgdrop_cli.records.store import RunRecord\n"
        "run = RunRecord(Path(), {'run_id': 'a', 'env_steps': 0})\n"
        "task = Task(root=Path(), trained=(run,), broken_links=(0.0,), episodes=1, device='cpu')\n"
        "Path(sys.argv[1], 'stop').touch()\n"
        "print(work(task, Control(Path(sys.argv[1])))[0].status, 'torch' in sys.modules)\n"
    )
    command = [sys.executable, "-c", program, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == "interrupted False\n", done.stderr


def test_a_stop_after_training_leaves_the_evaluation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever is asked to stop when the training is done does not begin to evaluate."""
    train = run_module.train_cohort

    def stop_then(*arguments: Any, **options: Any) -> list[run_module.RunOutcome]:
        outcomes = train(*arguments, **options)
        (control.folder / "stop").touch()
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
    """Everything is checkpointed and the way to go on is said (10 s on a machine that is idle)."""
    process = start(workers)
    wait_for(lambda: len(list(tmp_path.rglob("progress.json"))) == workers)
    os.killpg(process.pid, signum)  # a terminal sends it to the workers, too
    _, err = process.communicate(timeout=60)
    assert process.returncode == code, err
    assert "stopping: writing checkpoints" in err
    assert "the same command goes on:\n  msgdrop train" in err
    assert words_of(tmp_path) == ["interrupted"] * workers
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


def test_kill_9_of_the_parent_leaves_no_worker(start: Start, tmp_path: Path) -> None:
    """Workers die with the process that started them, however it ends."""
    process = start(2)
    wait_for(lambda: len(list(tmp_path.rglob("progress.json"))) == 2)
    workers = children(process.pid)
    assert len(workers) >= 2
    process.kill()
    wait_for(lambda: not any(map(alive, workers)))
