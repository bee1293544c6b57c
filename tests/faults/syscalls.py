"""Trials in which one system call on the results folder fails, or is the last one: by strace.

What an undisturbed run calls is looked up first. Each call with each error is a case; the trials
take them in an order of fixed seed, so that however few they are, they come from all of a run. A
write that takes only a part is met on full disks (`disks.py`): strace cannot make one.
"""

import os
import re
import shutil
import signal
import subprocess
from pathlib import Path
from random import Random

from tests.faults.row import NotHere, Trial, expect
from tests.faults.study import Running, command, go_on, start

CALLS = ("openat", "write", "fsync", "rename", "mkdir", "unlink", "unlinkat", "rmdir", "ftruncate")
FAULTS = ("error=ENOSPC", "error=EIO", "error=EINTR", "signal=KILL")
_CODES = (0, 3, 73, 74)
_ORDER = 20190127
"""Seed of the order of the cases (ours)."""


def fail_a_call(trial: Trial) -> None:
    """Call number `when` of one kind fails: old or new, never torn, and the command says so."""
    cases = [(*call, fault) for call in _calls(trial) for fault in FAULTS]
    Random(_ORDER).shuffle(cases)
    name, when, fault = cases[trial.number % len(cases)]
    what = f"{name} number {when}, {fault}"
    results = trial.folder / "results"
    again = command(trial.bench, results)
    process = _traced(trial, f"inject={name}:{fault}:when={when}", results)
    code = process.wait()
    expect("Traceback" not in process.said, f"{what}: a traceback was shown")
    if fault == "signal=KILL":
        expect(code in (0, -signal.SIGKILL), f"{what}: ended with {code}")
    else:
        expect(code in _CODES, f"{what}: ended with {code}: {process.last_line()}")
        if fault == "error=EINTR" and name in ("openat", "write", "fsync", "ftruncate"):
            expect(code == 0, f"{what}: Python tries again: {code}: {process.last_line()}")
    go_on(trial, again)


def _traced(trial: Trial, expression: str, results: Path) -> Running:
    """The study, stopped before it begins until strace holds it."""
    if shutil.which("strace") is None:
        raise NotHere("strace is not installed")
    process = start(
        command(trial.bench, results), trial.folder, lambda: os.kill(os.getpid(), signal.SIGSTOP)
    )
    os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WNOWAIT)
    log = trial.folder / "strace"
    names = f"trace={','.join(CALLS)}"
    tracer = subprocess.Popen(
        [
            "strace",
            "-y",
            "-s",
            "0",
            "-e",
            names,
            "-e",
            expression,
            "-o",
            log,
            "-p",
            str(process.pid),
        ],
        stderr=subprocess.PIPE,
        text=True,
    )
    assert tracer.stderr is not None
    if "attached" not in (said := tracer.stderr.readline()):
        process.send()
        process.wait()
        raise NotHere(f"strace cannot trace here: {said.strip()}")
    process.send(signal.SIGCONT)
    return process


def _calls(trial: Trial) -> list[tuple[str, int]]:
    """Every call of an undisturbed run that touches its results: its name, and which of that name.

    Looked up once for all trials: how many there are before one depends little on the moment.
    """
    kept = trial.bench / "calls"
    if not kept.exists():
        folder = trial.folder / "look"
        folder.mkdir()
        process = _traced(trial, "signal=none", folder / "results")
        expect(process.wait() == 0, process.last_line())
        (trial.folder / "strace").rename(kept)  # whoever else looks at this moment finds the same
    found, count = [], dict.fromkeys(CALLS, 0)
    for line in kept.read_text().splitlines():
        if match := re.match(r"(\w+)\(", line):
            count[match[1]] += 1
            if "/results/" in line:
                found.append((match[1], count[match[1]]))
    return found
