"""Trials that change nothing that counts: workers, order, terminals, resumes, and the clock."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable

from tests.cli_runs import ROOT
from tests.faults.oracle import check_same
from tests.faults.row import NotHere, Trial, expect
from tests.faults.study import command, go_on, newest_checkpoint, start, undisturbed, wait_until

_CLOCKS = {
    "1970": ["@1970-01-02 00:00:00"],
    "a day ahead": ["+1d"],
    "a fast clock": ["+0 x50"],
    "the end of summer time": ["@2026-10-25 02:59:59"],
}
_PROGRAM = """\
import runpy, select, time
time.sleep = lambda seconds: select.select((), (), (), seconds)
runpy.run_module("msgdrop_cli", run_name="__main__", alter_sys=True)
"""
"""libfaketime moves what `clock_nanosleep` waits for by what it added to the clock of the day, even
where the monotonic clock is left alone: EINVAL in every `time.sleep` (0.9.10)."""


def same_seed_again(trial: Trial) -> None:
    """One digest by 1, 2 or 3 workers, in any order of the seeds, seen or not, resumed or not."""
    ways: tuple[Callable[[Trial], None], ...] = (
        _alone_after_another,
        _in_one_cohort,
        _resumed,
        _by_workers,
    )
    ways[trial.number % len(ways)](trial)


def other_clock(trial: Trial) -> None:
    """1970, a day ahead, running away, set back: no time is negative."""
    if shutil.which("faketime") is None:
        raise NotHere("faketime is not installed")
    results = trial.folder / "results"
    name = list(_CLOCKS)[trial.number % len(_CLOCKS)]
    done = subprocess.run(
        [
            "faketime",
            "-f",
            *_CLOCKS[name],
            sys.executable,
            "-c",
            _PROGRAM,
            *command(trial.bench, results),
        ],
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations")),
            "FAKETIME_DONT_FAKE_MONOTONIC": "1",  # no clock that is set changes this one
            "TZ": "Europe/Berlin",
        },
        capture_output=True,
        text=True,
        timeout=120,
    )
    expect(done.returncode == 0, f"{name}: {done.returncode}: {done.stderr.strip()[-200:]}")
    expect(" -" not in done.stderr.replace(" --", ""), f"{name}: a time is negative")
    check_same(undisturbed(trial), results)


def _alone_after_another(trial: Trial) -> None:
    """Both seeds, the second one first, each by a command of its own."""
    results = trial.folder / "results"
    for seed in ("2", "1"):
        again = command(trial.bench, results)
        again[again.index("--seed") + 1] = seed
        process = start(again, trial.folder)
        expect((code := process.wait()) == 0, f"{code}: {process.last_line()}")
    check_same(undisturbed(trial, 2), results)


def _in_one_cohort(trial: Trial) -> None:
    """Both seeds stacked, as on a GPU."""
    from msgdrop_cli.commands.parts import carry_out
    from msgdrop_cli.definition.cohorts import group

    def stack() -> None:
        carry_out.cohorts = lambda runs, _: group(runs, len(runs))  # type: ignore[attr-defined, assignment]

    results = trial.folder / "results"
    process = start(command(trial.bench, results, seeds=2), trial.folder, stack)
    expect((code := process.wait()) == 0, f"{code}: {process.last_line()}")
    check_same(undisturbed(trial, 2), results)


def _resumed(trial: Trial) -> None:
    """Stopped with a checkpoint at any step, and the same command again."""
    results = trial.folder / "results"
    again = command(trial.bench, results)
    process = start(again, trial.folder)
    reached = trial.rng.randrange(80, 400, 80)
    if wait_until(lambda: newest_checkpoint(results) >= reached, process):
        process.send(signal.SIGTERM)
    process.wait()
    go_on(trial, again)


def _by_workers(trial: Trial) -> None:
    """Two or three workers for two seeds."""
    results = trial.folder / "results"
    workers = trial.rng.choice((2, 3))
    process = start(command(trial.bench, results, seeds=2, workers=workers), trial.folder)
    expect((code := process.wait()) == 0, f"{code}: {process.last_line()}")
    check_same(undisturbed(trial, 2), results)
