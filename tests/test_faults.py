"""The fault table: a small share of every row, and the oracle that it believes.

In full: `make faults`.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from safetensors.torch import load_file, save_file

from msgdrop_cli.engine.run import train_cohort
from tests.cli_runs import ROOT
from tests.faults.oracle import first_difference
from tests.faults.table import ROWS
from tests.runs import planned

Results = dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def results() -> Results:
    """What came of a share of each row: all of them in one process, which loads everything once."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.faults", "--share", "--json"],
        cwd=ROOT,
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations")),
            "OMP_NUM_THREADS": "1",
        },
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.stdout, done.stderr
    return {each["row"]: each for each in json.loads(done.stdout)}


@pytest.mark.slow
@pytest.mark.parametrize("row", [row.name for row in ROWS if row.share])
def test_a_share_of_the_fault_table_survives(results: Results, row: str) -> None:
    """The failure names its trial, and how to repeat it."""
    found = results[row]
    if found["not_here"]:
        pytest.skip(found["not_here"])
    again = f'python -m tests.faults --row "{row}" --trial {" ".join(map(str, found["failed"]))}'
    assert found["first_failure"] is None, f"{found['first_failure']}; {again}"
    assert found["survived"] == found["trials"] > 0


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A results folder with one run, and an evaluation in words."""
    root = tmp_path_factory.mktemp("trained") / "results"
    [outcome] = train_cohort([planned()], root)
    (outcome.path / "episodes.jsonl").write_text('{"broken_links": 0.0, "episode": 0}\n')
    return root


def change_policy(run: Path) -> None:
    """One weight has another sign."""
    file = run / "policy.safetensors"
    weights = load_file(file)
    weights[min(weights)].neg_()
    save_file(weights, file)


def change_log(run: Path) -> None:
    """A window of the log has another number."""
    lines = (run / "metrics.jsonl").read_text().splitlines()
    row = json.loads(lines[2])
    lines[2] = json.dumps({**row, "loss": 0.125})
    (run / "metrics.jsonl").write_text("\n".join(lines) + "\n")


def change_record(run: Path) -> None:
    """The record has another number of env steps."""
    record = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps({**record, "env_steps": 7}))


CHANGES: dict[str, Callable[[Path], object]] = {
    "policy: ": change_policy,
    "metrics row 2: loss": change_log,
    "episodes": lambda run: (run / "episodes.jsonl").write_text('{"episode": 1}\n'),
    "record": change_record,
}


@pytest.mark.parametrize("what", CHANGES)
def test_the_oracle_names_what_differs(trained: Path, tmp_path: Path, what: str) -> None:
    """One quantity was changed, and that one is named."""
    shutil.copytree(trained, tmp_path / "results")
    assert first_difference(trained, tmp_path / "results") is None
    CHANGES[what](next(tmp_path.rglob("run.json")).parent)
    assert f": {what}" in str(first_difference(trained, tmp_path / "results"))


def test_the_oracle_misses_no_run(trained: Path, tmp_path: Path) -> None:
    """A run that is not there differs from one that is."""
    shutil.copytree(trained, tmp_path / "results")
    [other] = train_cohort([planned(seed=2, train_env_steps=80)], tmp_path / "results")
    (other.path / "episodes.jsonl").touch()
    assert "is on one side only" in str(first_difference(trained, tmp_path / "results"))
