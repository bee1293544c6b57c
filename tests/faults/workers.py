"""Trials on worker processes: their parent is killed, or one dies, or gets no memory."""

import os
import re
import resource
import signal
import time
from contextlib import suppress
from pathlib import Path

from tests.faults.oracle import check_same
from tests.faults.row import Trial, expect
from tests.faults.study import (
    Running,
    command,
    go_on,
    slowness,
    start,
    undisturbed,
    wait_until,
)
from tests.processes import alive, children, words_of, workers_of

_GONE_WITHIN_S = 2.0
_OUR_TRACEBACK = re.compile(r'/msgdrop_cli/[^"]*", line \d+, in .*')
"""Of an exception. Where a worker was when it crashed is told, too, without this comma: loky has
Python do that (faulthandler)."""
_DEADLY = 5
"""One trial of so many kills every worker that takes one of the runs."""


def kill_the_parent(trial: Trial) -> float | None:
    """Kill -9 of the parent alone: its workers die with it; returns how long they lived on."""
    again = command(trial.bench, trial.folder / "results", seeds=2, workers=2)
    process = start(again, trial.folder)
    wait_until(lambda: len(workers_of(process.pid)) == 2, process)
    time.sleep(trial.rng.uniform(0.0, 4.0))
    below = children(process.pid)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    began = time.monotonic()
    while any(map(alive, list(below))):
        limit = _GONE_WITHIN_S * slowness()  # who has only begun to start asks a little later
        expect(time.monotonic() - began < limit, f"a worker lives on after {limit:.0f} s")
        time.sleep(0.005)
    lived = time.monotonic() - began
    go_on(trial, again, seeds=2)
    return lived


def lose_a_worker(trial: Trial) -> None:
    """A worker is killed, crashes or gets no more memory: its sibling loses nothing."""
    if trial.number % _DEADLY == _DEADLY - 1:
        _lose_all_of_one_run(trial)
        return
    results = trial.folder / "results"
    again = command(trial.bench, results, seeds=2, workers=2)
    process = start(again, trial.folder)
    wait_until(lambda: len(workers_of(process.pid)) == 2, process)
    time.sleep(trial.rng.uniform(0.0, 4.0))
    kind = trial.rng.choice(("killed", "crashed", "no memory"))
    for pid in workers_of(process.pid)[:1]:
        if kind == "no memory":
            _take_memory_from(pid)
        else:
            with suppress(ProcessLookupError):  # it has ended
                os.kill(pid, signal.SIGKILL if kind == "killed" else signal.SIGSEGV)
    code = process.wait()
    fine = (0,) if kind != "no memory" else (0, 3, 74)
    expect(code in fine, f"{kind}: ended with {code}: {process.last_line()}")
    # A worker that gets no memory for Python's own start has nothing but Python to say so.
    ours = _OUR_TRACEBACK.search(process.said)
    expect(not ours, f"{kind}: a traceback of ours was shown: {ours and ours[0]}")
    if code == 0:
        check_same(undisturbed(trial, 2), results)
    go_on(trial, again, seeds=2)


def _lose_all_of_one_run(trial: Trial) -> None:
    """Whoever takes the first run dies: it fails after three tries, and the other one is done."""
    results = trial.folder / "results"
    again = command(trial.bench, results, seeds=2, workers=2)
    process = start(again, trial.folder)
    deaths = 0
    while wait_until(lambda: _holders(process, results), process):
        for pid in _holders(process, results):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
                deaths += 1
            wait_until(lambda pid=pid: not alive(pid), process)  # type: ignore[misc]
    code = process.wait()
    expect(code == 3, f"ended with {code}, not 3: {process.last_line()}")
    expect(words_of(results) == ["done", "failed"], f"the runs are {words_of(results)}")
    expect(deaths == 3, f"tried {deaths} times")
    go_on(trial, again, seeds=2)


def _holders(process: Running, results: Path) -> list[int]:
    """The workers that have the lock of the first run's folder open."""
    locks = {str(path) for path in results.glob("runs/*/*-s1-*/lock")}
    found = []
    for pid in workers_of(process.pid):
        try:
            handles = [str(each.readlink()) for each in Path(f"/proc/{pid}/fd").iterdir()]
        except OSError:
            continue
        if locks.intersection(handles):
            found.append(pid)
    return found


def _take_memory_from(pid: int) -> None:
    """Let it have no more memory than it has now."""
    with suppress(OSError, IndexError):  # it has ended
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[0])
        now = pages * resource.getpagesize()
        resource.prlimit(pid, resource.RLIMIT_AS, (now, now))
