"""Scheduler, workers and command on machines that share nothing but a network (see machines.py)."""

import json
import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from msgdrop_cli.cluster.tasks import GONE
from msgdrop_cli.records.store import list_runs
from tests.cli_runs import QUESTION, msgdrop
from tests.dask_processes import DASK
from tests.faults.study import slowness
from tests.machines import PORT, Machines, machines, permitted
from tests.processes import wait_for
from tests.runs import digest

pytest.importorskip("distributed")
pytestmark = pytest.mark.skipif("MSGDROP_MACHINES" not in os.environ, reason="minutes: make faults")


TIME_TO_LIVE_S, BEYOND_S = 10, 30


@pytest.fixture
def network(monkeypatch: pytest.MonkeyPatch) -> Iterator[Machines]:
    """A scheduler and two workers with a short time to live; who asks is at the desk."""
    if not permitted():
        pytest.skip("needs network namespaces")
    monkeypatch.setitem(DASK, "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL", f"{TIME_TO_LIVE_S} s")
    with machines("head", "one", "two", "desk") as made:
        made.scheduler("head")
        for name in ("one", "two"):
            made.worker(name, "head")
        yield made


def question(folder: Path, env_steps: int) -> Path:
    """Four runs of so many steps."""
    file = folder / "tiny.toml"
    file.write_text(QUESTION.replace("train_env_steps = 200", f"train_env_steps = {env_steps}"))
    return file


def ask(network: Machines, file: Path, results: Path) -> subprocess.Popen[bytes]:
    """The command, on a machine whose results folder nobody else sees."""
    where = f"dask://{network.address('head')}:{PORT}"
    words = ("ablate", file, "--results", results, "--cluster", where)
    return network.begin("desk", "-m", "msgdrop_cli", *words, shares=True)


def ended(process: subprocess.Popen[bytes], code: int = 0) -> str:
    """What it said, if it ended so."""
    said = process.communicate(timeout=500)[0].decode()
    assert process.returncode == code, said
    return said


def cut_at_work(network: Machines, name: str, file: Path, results: Path) -> subprocess.Popen[bytes]:
    """The command, whose two workers are at work when this machine's wire is cut."""
    process = ask(network, file, results)
    wait_for(lambda: len(list(results.glob("runs/*/*/progress.json"))) == 2, 120.0)
    network.cut(name)
    return process


def check_same(file: Path, results: Path, here: Path) -> None:
    """The runs of another folder are those that this process makes of the question."""
    assert msgdrop("ablate", file, "--results", here, "--workers", "1").code == 0
    ours, theirs = ({r.run_id: digest(r.path) for r in list_runs(f)} for f in (here, results))
    assert ours == theirs


def test_runs_come_back_from_machines_that_share_nothing(network: Machines, tmp_path: Path) -> None:
    """Other addresses, host names and folders: the same runs, and each says who made it."""
    file, results = question(tmp_path, 2_000), tmp_path / "results"
    said = ended(ask(network, file, results))
    assert "2 workers on 2 machines; they do not see the results folder" in said
    nodes = {path: json.loads(path.read_text())["node"] for path in results.rglob("run.json")}
    assert set(nodes.values()) == {"one", "two"}
    check_same(file, results, tmp_path / "here")


@pytest.mark.parametrize("back_after_s", [None, 15.0])
def test_a_cut_wire_loses_nothing(
    back_after_s: float | None, network: Machines, tmp_path: Path
) -> None:
    """A worker is cut off for good, or for a while: its run is done, in time, and the same."""
    file, results = question(tmp_path, 10_000), tmp_path / "results"
    process = cut_at_work(network, "two", file, results)
    began = time.monotonic()
    if back_after_s is not None:
        time.sleep(back_after_s)
        network.mend("two")
    ended(process)
    assert time.monotonic() - began < (TIME_TO_LIVE_S + BEYOND_S) * max(slowness(), 2.0)
    assert "nothing to train" in ended(ask(network, file, results))
    check_same(file, results, tmp_path / "here")


def test_who_asked_is_cut_off_and_asks_again(network: Machines, tmp_path: Path) -> None:
    """The command ends with a line that says what to do; asked again, it goes on."""
    file, results = question(tmp_path, 20_000), tmp_path / "results"
    process = cut_at_work(network, "desk", file, results)
    began = time.monotonic()
    assert GONE in ended(process, code=3)
    assert time.monotonic() - began < (TIME_TO_LIVE_S + BEYOND_S) * max(slowness(), 2.0)
    network.mend("desk")
    ended(ask(network, file, results))
    check_same(file, results, tmp_path / "here")
