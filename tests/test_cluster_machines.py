"""Scheduler, workers and command on machines that share nothing but a network (see machines.py)."""

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from msgdrop_cli.records.store import list_runs
from tests.cli_runs import QUESTION, msgdrop
from tests.machines import PORT, Machines, machines, permitted
from tests.runs import digest

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow


@pytest.fixture
def network() -> Iterator[Machines]:
    """A scheduler and two workers; who asks is at the desk."""
    if not permitted():
        pytest.skip("needs network namespaces")
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


def ended(process: subprocess.Popen[bytes]) -> str:
    """What it said, if it ended well."""
    said = process.communicate(timeout=500)[0].decode()
    assert process.returncode == 0, said
    return said


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
