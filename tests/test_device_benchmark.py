"""benchmarks/device.py must work the first time it meets a GPU, so it runs here on the CPU."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from benchmarks import device

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[subprocess.CompletedProcess[str], Path]:
    """The command, run once as a stranger would: nothing of ours on the path."""
    out = tmp_path_factory.mktemp("device") / "new"
    command = [sys.executable, "-m", "benchmarks.device", "--device", "cpu", "--out", str(out)]
    bare = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    bare["PYTEST_ADDOPTS"] = "-k an_update_is_the_same"  # all of them are in this suite, too
    return subprocess.run(command, cwd=ROOT, env=bare, capture_output=True, text=True), out


def test_it_measures_everything(done: tuple[subprocess.CompletedProcess[str], Path]) -> None:
    """Every line stands in the file, none of them failed or was left out."""
    said, out = done
    assert said.returncode == 0, said.stderr
    rows = json.loads((out / "device.json").read_text())["rows"]
    names = [row["name"] for row in rows]
    assert names[:2] == ["machine", "float32 product of squares"]
    assert names[-3:] == ["2 x pursuit-n6", "where a step goes", "CUDA tests"]
    assert [row for row in rows if "failed" in row or "left_out" in row] == []
    assert rows[-3]["env_steps_per_s"] > 0
    assert all(row["name"] in said.stdout for row in rows)


def test_it_runs_the_cuda_tests(done: tuple[subprocess.CompletedProcess[str], Path]) -> None:
    """Pytest's own last line is passed on: without a GPU all are skipped."""
    rows = json.loads((done[1] / "device.json").read_text())["rows"]
    assert "skipped" in rows[-1]["said"] or "passed" in rows[-1]["said"]


def test_a_fault_is_a_line(tmp_path: Path) -> None:
    """What raises is written down, and the next line is measured."""
    report = device.Report(tmp_path, time.monotonic() + 60)
    report.add("bad", lambda: {"x": 1 / 0})
    report.add("good", lambda: {"x": 1})
    rows = json.loads((tmp_path / "device.json").read_text())["rows"]
    assert rows[0]["failed"] == "ZeroDivisionError: division by zero"
    assert rows[1]["x"] == 1


def test_nothing_is_begun_without_time(tmp_path: Path) -> None:
    """Close to the end lines are left out, and the file says so."""
    report = device.Report(tmp_path, time.monotonic() + device.RESERVE_S - 1)
    report.add("late", lambda: {"x": 1 / 0})
    assert json.loads((tmp_path / "device.json").read_text())["rows"][0]["left_out"] == "no time"


def test_missing_pytest_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bare machine may not have it; the rest is measured all the same."""
    monkeypatch.setattr(device, "find_spec", lambda name: None)
    assert device.cuda_tests(1.0) == {"left_out": "pytest is not installed here"}
