"""What a GPU makes of the engine: one command for a machine that is lent for some minutes.

    python -m benchmarks.device [--out DIR] [--device cuda|cpu] [--minutes 9]

Runs the CUDA tests, measures the device's own ceilings, and trains cohorts of growing size, told
step by step and as CUDA graphs. It needs torch and nothing that is installed of msgdrop, prints a
line as soon as it is known, and writes all of them to DIR/device.json each time, so that a machine
that is taken away takes nothing with it. On the CPU everything is tiny: only a test uses that.
"""

import argparse
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import torch

ROOT = Path(__file__).resolve().parents[1]
PATHS = [str(ROOT / root) for root in ("", "envs", "ablations")]
sys.path[:0] = PATHS

# ruff: noqa: E402 (what is ours can be found only now)
from benchmarks.device_cohorts import COHORTS, Cohort, kernels, throughput
from msgdrop_cli.engine import arithmetic
from msgdrop_cli.records.files import write_json_atomic

RESERVE_S = 30.0
"""No line is begun with less time than this left."""
TESTS_S = 200.0
"""The tests' share of the time, at most."""
Row = dict[str, Any]


@dataclass(slots=True)
class Report:
    """The lines so far, kept on disk after every one."""

    out: Path | None
    deadline: float
    rows: list[Row] = field(default_factory=list)

    @property
    def left_s(self) -> float:
        """Seconds until everything has to be written."""
        return self.deadline - time.monotonic()

    def add(self, name: str, measure: Callable[[], Row]) -> None:
        """Measure one line, whatever happens: a fault is a line, too."""
        start = time.monotonic()
        if self.left_s < RESERVE_S:
            row: Row = {"left_out": "no time"}
        else:
            try:
                row = measure()
            except Exception as error:  # the other lines are worth having
                row = {"failed": f"{type(error).__name__}: {error}"[:500]}
        row = {"name": name, **row, "seconds": round(time.monotonic() - start, 1)}
        self.rows.append(row)
        print(_line(row), flush=True)
        if self.out is not None:
            write_json_atomic(self.out / "device.json", {"rows": self.rows})


def _line(row: Row) -> str:
    shown = {key: value for key, value in row.items() if key not in ("name", "lines")}
    numbers = ", ".join(f"{key} {_number(value)}" for key, value in shown.items())
    lines = "".join(f"\n    {line}" for line in row.get("lines", ()))
    return f"{row['name']:<34} {numbers}{lines}"


def _number(value: object) -> str:
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1_000 else f"{value:.4g}"
    return str(value)


def machine(device: str) -> Row:
    """What it is."""
    row: Row = {"python": platform.python_version(), "torch": torch.__version__}
    if device == "cuda":
        card = torch.cuda.get_device_properties(0)
        row |= {"gpu": card.name, "gib": round(card.total_memory / 2**30, 1)}
        row |= {"cuda": torch.version.cuda, "tf32": torch.backends.cuda.matmul.allow_tf32}
    return row


def cuda_tests(seconds: float) -> Row:
    """What pytest says about tests/test_cuda.py, in a process of its own."""
    if find_spec("pytest") is None:
        return {"left_out": "pytest is not installed here"}
    options = ["-q", "-rfE", "-W", "default", "-p", "no:cacheprovider", "--tb=short"]
    command = [sys.executable, "-m", "pytest", "tests/test_cuda.py", *options]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(PATHS)}
    try:
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=seconds
        )
    except subprocess.TimeoutExpired as error:
        said = error.stdout or b""
        text = said.decode(errors="replace") if isinstance(said, bytes) else said
        return {"failed": f"not done in {seconds:.0f} s", "lines": text.splitlines()[-40:]}
    lines = done.stdout.splitlines()
    return {"said": lines[-1] if lines else done.stderr[-300:], "lines": lines[-80:-1]}


def ceilings(device: str) -> Iterator[tuple[str, Callable[[], Row]]]:
    """What the device can do at most: arithmetic, memory, launches."""
    side, numbers = (8_192, 2**30) if device == "cuda" else (128, 2**16)

    def matmul() -> Row:
        left, right = (torch.rand(side, side, device=device) for _ in range(2))
        seconds = _seconds(lambda: torch.mm(left, right), device, 10)
        return {"tflop_per_s": 2e-12 * side**3 / seconds}

    def products() -> Row:
        """The largest product of an update of 49 runs, pursuit N=6."""
        networks = 294 if device == "cuda" else 2
        inputs = torch.rand(networks, 64, 735, device=device)
        weights = torch.rand(networks, 735, 96, device=device)
        seconds = _seconds(lambda: torch.bmm(inputs, weights), device, 20)
        return {"tflop_per_s": 2e-12 * networks * 64 * 735 * 96 / seconds}

    def copy() -> Row:
        source = torch.zeros(numbers, device=device)
        target = torch.empty_like(source)
        return {"gb_per_s": 8e-9 * numbers / _seconds(lambda: target.copy_(source), device, 10)}

    def launch() -> Row:
        number = torch.zeros(1, device=device)
        return {"us": 1e6 * _seconds(lambda: number.add_(1), device, 2_000)}

    def replay() -> Row:
        number = torch.zeros(1, device=device)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            for _ in range(1_000):
                number.add_(1)
        return {"us_a_kernel": 1e6 * _seconds(graph.replay, device, 20) / 1_000}

    yield "float32 product of squares", matmul
    yield "float32 product of the first layer", products
    yield "copy", copy
    yield "launch of a tiny kernel", launch
    if device == "cuda":
        yield "the same within a graph", replay


def _seconds(call: Callable[[], object], device: str, repeats: int) -> float:
    """Of one call, the mean over some of them after one for warmth; the median of three."""
    found = []
    for _ in range(3):
        call()
        _finish(device)
        start = time.perf_counter()
        for _ in range(repeats):
            call()
        _finish(device)
        found.append((time.perf_counter() - start) / repeats)
    return sorted(found)[1]


def _finish(device: str) -> None:
    if device == "cuda":
        torch.cuda.synchronize()


def measure_all(report: Report, device: str) -> None:
    """Every line, the most telling ones first."""
    report.add("machine", lambda: machine(device))
    for name, ceiling in ceilings(device):
        report.add(name, ceiling)
    cohorts = COHORTS if device == "cuda" else [Cohort("pursuit-n6", "dcc-md", 2)]
    graphs = device == "cuda"
    for cohort in cohorts[:2]:
        report.add(cohort.name, lambda c=cohort: throughput(c, device, graphs))  # type: ignore[misc]
    report.add("where a step goes", lambda: kernels(COHORTS[0], device))
    report.add("CUDA tests", lambda: cuda_tests(min(TESTS_S, report.left_s / 2)))
    for cohort in cohorts[2:]:
        report.add(cohort.name, lambda c=cohort: throughput(c, device, graphs))  # type: ignore[misc]
    if graphs:
        report.add("told step by step", lambda: throughput(COHORTS[0], device, False))


@arithmetic.settled()
def main() -> None:
    """Print and write everything."""
    assert __doc__
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, help="folder for device.json")
    parser.add_argument("--device", choices=("cuda", "cpu"), default="cuda")
    parser.add_argument("--minutes", type=float, default=9.0, help="everything is written by then")
    options = parser.parse_args()
    if options.device == "cuda" and not torch.cuda.is_available():
        sys.exit("there is no CUDA device; --device cpu shows that the command works")
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
    measure_all(Report(options.out, time.monotonic() + 60 * options.minutes), options.device)


if __name__ == "__main__":
    main()
