"""Runs the fault table: `python -m tests.faults [--row NAME ... [--trial N ...]]`.

FAULTS=0.1 makes a tenth of the trials. Some run at a time, each in a process of its own.
"""

import argparse
import json
import math
import os
import resource
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from random import Random
from typing import NamedTuple

from tests.faults.row import Broken, NotHere, Row, Trial
from tests.faults.study import make_bench, warm_up
from tests.faults.table import ROWS


@dataclass(slots=True)
class Result:
    """What came of the trials of one row."""

    row: str
    promise: str
    trials: int = 0
    survived: int = 0
    worst_s: float = 0.0
    """Of what the promise gives a time to, else of a whole trial."""
    first_failure: str | None = None
    failed: list[int] = field(default_factory=list)
    """The numbers of the trials that found something, as they ended."""
    not_here: str | None = None


class _Told(NamedTuple):
    number: int
    seconds: float
    broken: str | None
    not_here: str | None


def main(arguments: Sequence[str]) -> int:
    """Run what is asked for; returns 1 if anything was broken."""
    asked = _asked(arguments)
    names = [row.name for row in ROWS]
    rows = [row for row in ROWS if row.name in (asked.row or names)]
    if len(rows) < len(asked.row or ()):
        print(f"no such row; there are: {', '.join(names)}")
        return 2
    scale = float(os.environ.get("FAULTS", "1"))
    results = []
    with tempfile.TemporaryDirectory(prefix="msgdrop-faults-") as name:
        bench = Path(name) / "bench"
        bench.mkdir()
        warm_up(bench)
        make_bench(bench)
        for row in rows:
            count = row.share if asked.share else max(math.ceil(row.trials * scale), 1)
            numbers = asked.trial or range(count)
            began, used = time.monotonic(), _cpu_s()
            results.append(_run(row, numbers, bench, Path(name)))
            if not asked.json:
                _show(results[-1], time.monotonic() - began, _cpu_s() - used)
    if asked.json:
        print(json.dumps([asdict(result) for result in results]))
    return int(any(result.first_failure for result in results))


def _asked(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--row", action="append", help="only this row of the table, and others")
    parser.add_argument(
        "--trial", type=int, nargs="+", help="only these trials of it, to repeat failures"
    )
    parser.add_argument("--share", action="store_true", help="as few trials as the test suite")
    parser.add_argument("--json", action="store_true", help="the results as JSON")
    return parser.parse_args(arguments)


def _run(row: Row, numbers: Sequence[int], bench: Path, folder: Path) -> Result:
    result = Result(row.name, row.promise)
    for told in _told(row, numbers, bench, folder):
        if told.not_here:
            result.not_here = told.not_here
            continue
        result.trials += row.each
        result.survived += row.each * (told.broken is None)
        result.worst_s = max(result.worst_s, told.seconds)
        if told.broken:
            result.failed.append(told.number)
            result.first_failure = result.first_failure or f"trial {told.number}: {told.broken}"
    result.worst_s = round(result.worst_s, 3)
    return result


def _told(row: Row, numbers: Sequence[int], bench: Path, folder: Path) -> Iterator[_Told]:
    """What each trial tells, as they end; some are at work at a time."""
    waiting, at_work = list(numbers), dict[int, int]()
    while waiting or at_work:
        while waiting and len(at_work) < row.at_a_time:
            number = waiting.pop(0)
            at_work[_begin(row, number, bench, folder)] = number
        pid, status = os.wait()
        if pid in at_work:
            number = at_work.pop(pid)
            said = folder / f"{number}.json"
            if said.exists():
                yield _Told(*json.loads(said.read_text()))
                said.unlink()
            else:
                yield _Told(number, 0.0, f"the trial itself died ({status})", None)


def _begin(row: Row, number: int, bench: Path, folder: Path) -> int:
    """Begin a trial in a process of its own."""
    sys.stdout.flush()
    if pid := os.fork():
        return pid
    try:
        with tempfile.TemporaryDirectory(dir=folder, ignore_cleanup_errors=True) as place:
            trial = Trial(
                number=number,
                folder=Path(place),
                bench=bench,
                rng=Random(f"{row.name} {number}"),
            )
            told = _tried(row, trial)
        (folder / f"{number}.json").write_text(json.dumps(told))
    finally:
        os._exit(0)


def _tried(row: Row, trial: Trial) -> _Told:
    began = time.monotonic()
    broken = not_here = took = None
    try:
        took = row.trial(trial)
    except Broken as error:
        broken = str(error)
    except NotHere as error:
        not_here = str(error)
    except Exception as error:
        broken = f"{type(error).__name__}: {error}"
    seconds = time.monotonic() - began if took is None else took
    return _Told(trial.number, seconds, broken, not_here)


def _cpu_s() -> float:
    """Processor time of all trials so far; of an orphan it is not known."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _show(result: Result, seconds: float, cpu_seconds: float) -> None:
    counts = f"{result.survived:>7,} of {result.trials:,}"
    print(f"{result.row:<14}{counts:<20}worst {result.worst_s:.2f} s   {result.promise}"
          f"   ({seconds:.0f} s, {cpu_seconds:.0f} s of the processor)", flush=True)  # fmt: skip
    if result.not_here:
        print(f"{'':<14}not tried: {result.not_here}")
    if result.first_failure:
        numbers = " ".join(map(str, result.failed))
        print(f"{'':<14}{result.first_failure}")
        print(f'{"":<14}python -m tests.faults --row "{result.row}" --trial {numbers}')


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
