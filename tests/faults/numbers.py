"""Trials in which a number stops being finite: in a weight, a moment, or the replay memory."""

import json
import math
from collections.abc import Callable
from random import Random

from msgdrop_cli.engine.checkpoint import Checkpoints, state_of
from msgdrop_cli.engine.training import Training
from msgdrop_cli.records.files import count_jsonl
from msgdrop_cli.records.store import METRICS, list_runs
from tests.faults.row import Trial, expect
from tests.faults.study import INTERVAL, LOGGED, STEPS, command, start


def lose_a_number(trial: Trial) -> None:
    """NaN or Inf at any step in one of two runs: it is `diverged`, the other one is done."""
    results = trial.folder / "results"
    step = trial.rng.randrange(120, STEPS - LOGGED, 4)
    bad = trial.rng.choice((math.nan, math.inf, -math.inf))
    spoil = _spoil(trial.rng, step, bad)
    process = start(command(trial.bench, results, seeds=2), trial.folder, spoil)
    code = process.wait()
    what = f"{bad} at {step}"
    expect(code == 3, f"{what}: ended with {code}: {process.last_line()}")
    records = {record.seed: record for record in list_runs(results)}
    words = {seed: record.status for seed, record in records.items()}
    expect(words == {1: "diverged", 2: "done"}, f"{what}: the runs are {words}")
    reason = str(records[1].reason)
    expect("is not finite at " in reason, f"{what}: the reason is {reason}")
    said = int(reason.rsplit(" is not finite at ", 1)[1].split()[0])
    expect(step <= said <= step + LOGGED + 4, f"{what}: seen at {said} only")
    path = records[1].path
    last = Checkpoints(path, records[1].run_id).latest(count_jsonl(path / METRICS))
    if step > 2 * INTERVAL:
        expect(last is not None, f"{what}: no checkpoint is kept")
    if last is not None:
        finite = all(bool(t.isfinite().all()) for t in last.state.values())
        expect(finite and last.counters.env_steps <= step, f"{what}: the checkpoint is spoilt")
    for line in (path / METRICS).read_text().splitlines():
        json.loads(line, parse_constant=lambda word: expect(False, f"{word} in the log"))


def _spoil(rng: Random, step: int, bad: float) -> Callable[[], None]:
    """What makes one number of the first run bad, when it has trained so far."""
    choice = rng.random()

    def patch() -> None:
        advance = Training.advance

        def spoilt(training: Training) -> None:
            advance(training)
            if training.env_steps == step and training.streams._seeds[0] == 1:
                state = state_of(training, 0)
                names = [
                    n for n in sorted(state) if n.startswith(("learner.online", "learner.exp"))
                ]
                state[names[int(choice * len(names))]].view(-1)[0] = bad

        Training.advance = spoilt  # type: ignore[method-assign, assignment]

    return patch
