"""Trials with others in the same folder: a second runner, readers, and a writer that comes back."""

import shutil
import signal
import time

from tests.faults.oracle import check_same
from tests.faults.row import Trial, expect
from tests.faults.study import check_tidy, command, go_on, seconds_undisturbed, start, undisturbed

READS = 10
"""Looks of the readers in one trial."""


def two_runners(trial: Trial) -> None:
    """The same command twice at once: one writes a run, the other says who is busy, or shares."""
    seeds = 1 + trial.number % 2
    results = trial.folder / "results"
    again = command(trial.bench, results, seeds=seeds)
    first = start(again, trial.folder)
    time.sleep(trial.rng.uniform(0.0, 0.5 * seconds_undisturbed(trial)))
    second = start(again, trial.folder)
    codes = first.wait(), second.wait()
    for process, code in zip((first, second), codes, strict=True):
        expect(code in (0, 3, 75), f"ended with {code}: {process.last_line()}")
        expect("Traceback" not in process.said, "a traceback was shown")
        if code:
            expect("is in use by another process" in process.said, f"{process.last_line()}")
    expect(0 in codes or seeds == 2, f"nobody was done: {codes}")
    go_on(trial, again, seeds=seeds)


def read_in_a_loop(trial: Trial) -> float:
    """`status` and `plot` while it trains: no half record, and the training never blocks."""
    results = trial.folder / "results"
    again = command(trial.bench, results)
    began = time.monotonic()
    process = start(again, trial.folder)
    for number in range(READS):
        what = "plot" if number % READS == READS - 1 else "status"
        reader = start([what, str(results)], trial.folder)
        code = reader.wait()
        expect("damaged" not in reader.said, f"{what} saw half a record: {reader.last_line()}")
        expect("Traceback" not in reader.said, f"{what} showed a traceback")
        expect(code in (0, 2), f"{what} ended with {code}: {reader.last_line()}")
    expect((code := process.wait()) == 0, f"{code}: {process.last_line()}")
    took = time.monotonic() - began
    check_same(undisturbed(trial), results)
    check_tidy(results)
    return took


def wake_a_stale_writer(trial: Trial) -> None:
    """Stopped, its folder made anew by the same command, continued: it writes nothing there."""
    results = trial.folder / "results"
    again = command(trial.bench, results)
    stale = start(again, trial.folder)
    time.sleep(trial.rng.uniform(0.0, seconds_undisturbed(trial)))
    stale.send(signal.SIGSTOP)
    shutil.rmtree(results / "runs", ignore_errors=True)
    go_on(trial, again)
    before = {path: path.read_bytes() for path in results.rglob("run.json")}
    stale.send(signal.SIGCONT)
    code = stale.wait()
    # 0: it was not yet at work, or had just ended; it then found everything done.
    expect(code in (0, 2, 3, 73, 74, 75), f"the stale one ended with {code}: {stale.last_line()}")
    expect("Traceback" not in stale.said, "a traceback was shown")
    after = {path: path.read_bytes() for path in results.rglob("run.json")}
    expect(after == before, "the record was changed")
    check_same(undisturbed(trial), results)
