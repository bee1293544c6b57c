"""Trials that ask for the end: Ctrl-C once and twice, SIGTERM, SIGHUP."""

import signal
import time
from functools import partial
from pathlib import Path

from msgdrop_cli.engine import run as run_module
from msgdrop_cli.records.files import count_jsonl
from tests.faults.row import Trial, expect
from tests.faults.study import (
    LOGGED,
    STEPS,
    command,
    go_on,
    seconds_undisturbed,
    slowness,
    start,
    wait_until,
)
from tests.processes import words_of

_WORDS_WITHIN_S, _STOPS_WITHIN_S, _ENDS_WITHIN_S = 0.1, 10.0, 1.0
_WORKERS = 10
"""One trial of so many trains on two workers."""


def ask_once(signum: signal.Signals, trial: Trial) -> float | None:
    """One signal in training: returns how long its words took."""
    workers = 2 if trial.number % _WORKERS == _WORKERS - 1 else 1
    results = trial.folder / "results"
    again = command(trial.bench, results, seeds=workers, workers=workers)
    process = start(again, trial.folder, _look_often)
    took, early = None, False
    if wait_until(lambda: _windows(results), process):
        time.sleep(trial.rng.uniform(0.0, 0.5 * seconds_undisturbed(trial)))
        early = _windows(results) < workers * STEPS // LOGGED // 2
        asked = time.monotonic()
        process.send(signum)
        if wait_until(lambda: "stopping: writing checkpoints" in process.said, process, 20.0):
            took = time.monotonic() - asked
    code = process.wait(_STOPS_WITHIN_S * slowness())
    said = process.said
    if early or "stopping: " in said:
        expect(code == 128 + signum, f"ended with {code}: {process.last_line()}")
        expect("the same command goes on:\n  msgdrop ablate" in said, "how to go on is not said")
        words = words_of(results)  # at the last steps it comes too late to interrupt anybody
        expect("interrupted" in words or not early, f"the runs are {words}")
    else:  # it came after the training
        expect(code in (0, 128 + signum), f"ended with {code}: {process.last_line()}")
    limit = _WORDS_WITHIN_S * slowness()
    expect(took is None or took < limit, f"words took {took} s, more than {limit:.1f}")
    expect("Traceback" not in said, "a traceback was shown")
    go_on(trial, again, seeds=workers)
    return took


def ask_twice(trial: Trial) -> float | None:
    """Ctrl-C again a moment later: returns how long the end took."""
    results = trial.folder / "results"
    again = command(trial.bench, results)
    process = start(again, trial.folder)
    took = None
    if wait_until(lambda: _windows(results), process):
        time.sleep(trial.rng.uniform(0.0, 0.5 * seconds_undisturbed(trial)))
        process.send(signal.SIGINT)
        time.sleep(trial.rng.uniform(0.0, 0.02))
        asked = time.monotonic()
        process.send(signal.SIGINT)
        code = process.wait()
        took = time.monotonic() - asked
        limit = _ENDS_WITHIN_S * slowness()
        expect(took < limit, f"the end took {took:.1f} s, more than {limit:.1f}")
        expect(code in (0, 130), f"ended with {code}: {process.last_line()}")
    else:
        process.wait()
    go_on(trial, again)
    return took


def _windows(results: Path) -> int:
    """Rows that the logs have."""
    return sum(count_jsonl(log) for log in results.glob("runs/*/*/metrics.jsonl"))


def _look_often() -> None:
    """A run of a second would be over before it looks whether to stop."""
    run_module._LOOK_UP_EVERY_S = 0.02


ctrl_c, terminate, hang_up = (
    partial(ask_once, each) for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
)
