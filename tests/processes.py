"""Tiny runs, and real processes that train them, for the tests of workers and signals."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from msgdrop_cli.definition.channel import NONE_BROKEN
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.records.files import read_json
from msgdrop_cli.scheduler import Task

TINY = (
    *("training.games=4", "training.log_every_env_steps=50", "environment.time_limit=40"),
    *("algorithm.replay_capacity=400", "algorithm.replay_start_env_steps=100"),
)


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
        Task(root=root, train=(run,), channels=(NONE_BROKEN,), episodes=4, device="cpu")
        for run in runs
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


def workers_of(parent: int) -> list[int]:
    """The joblib workers of this process."""
    return [pid for pid in children(parent) if b"popen_loky" in command_line(pid)]


def command_line(pid: int) -> bytes:
    """The words that a process was started with; nothing if it has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def words_of(root: Path) -> list[str]:
    """The status words of all runs."""
    return sorted(read_json(path)["status"] for path in root.rglob("run.json"))
