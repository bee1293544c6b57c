"""Trials that kill everything, and the same command again."""

import time
from functools import partial
from pathlib import Path

from msgdrop_cli.records.files import count_jsonl
from tests.faults.row import Trial, expect
from tests.faults.study import (
    INTERVAL,
    LOGGED,
    command,
    go_on,
    newest_checkpoint,
    seconds_undisturbed,
    start,
    wait_until,
)


def kill_everything(trial: Trial) -> None:
    """Kill -9 at any moment between the start and the end."""
    results = trial.folder / "results"
    again = command(trial.bench, results)
    process = start(again, trial.folder)
    time.sleep(trial.rng.uniform(0.0, seconds_undisturbed(trial)))
    process.send()
    process.wait()
    logged = sum(count_jsonl(log) for log in results.glob("runs/*/*/metrics.jsonl")) * LOGGED
    kept = newest_checkpoint(results)
    if kept:
        expect(logged - kept <= INTERVAL, f"at {logged} env steps the checkpoint was of {kept}")
    go_on(trial, again)


def kill_again_and_again(trial: Trial) -> None:
    """Kill -9 a moment after each checkpoint, until it is done."""
    results = trial.folder / "results"
    again = command(trial.bench, results)
    for _ in range(20):
        before = newest_checkpoint(results)
        process = start(again, trial.folder)
        if not wait_until(partial(_is_beyond, results, before), process):
            expect((code := process.wait()) == 0, f"{code}: {process.last_line()}")
            break
        time.sleep(trial.rng.uniform(0.0, 0.2))
        process.send()
        process.wait()
        after = newest_checkpoint(results)
        expect(after > before or not after, f"went back from {before} to {after} env steps")
    go_on(trial, again)


def _is_beyond(results: Path, env_steps: int) -> bool:
    return newest_checkpoint(results) > env_steps
