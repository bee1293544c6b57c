"""Trials in which a number stops being finite: a loss, a reward, a gradient, or any weight."""

import json
import math
from collections.abc import Callable
from random import Random
from typing import Any

from torch import Tensor

from msgdrop_cli.algorithms.cohort import RunningMeans
from msgdrop_cli.engine.checkpoint import Checkpoints, state_of
from msgdrop_cli.engine.training import Training
from msgdrop_cli.records.files import count_jsonl
from msgdrop_cli.records.store import METRICS, list_runs
from msgdrop_envs import autoreset
from tests.faults.row import Trial, expect
from tests.faults.study import GAMES, INTERVAL, LOGGED, STEPS, command, start

_KINDS = {"loss": GAMES, "reward": GAMES, "gradient": GAMES, "number": LOGGED + GAMES}
"""Within how many env steps it is seen: of an update, and of a row of the log where it may sleep:
a weight of an input that is 0, a moment that only stops a weight."""


def lose_a_number(trial: Trial) -> None:
    """NaN or Inf at any step in one of two runs: it is `diverged`, the other one is done."""
    results = trial.folder / "results"
    step = trial.rng.randrange(120, STEPS - LOGGED, GAMES)
    bad = trial.rng.choice((math.nan, math.inf, -math.inf))
    kind = list(_KINDS)[trial.number % len(_KINDS)]
    spoil = _spoil(trial.rng, kind, step, bad)
    process = start(command(trial.bench, results, seeds=2), trial.folder, spoil)
    code = process.wait()
    what = f"a {kind} {bad} at {step}"
    expect(code == 3, f"{what}: ended with {code}: {process.last_line()}")
    records = {record.seed: record for record in list_runs(results)}
    words = {seed: record.status for seed, record in records.items()}
    expect(words == {1: "diverged", 2: "done"}, f"{what}: the runs are {words}")
    reason = str(records[1].reason)
    expect("is not finite at " in reason, f"{what}: the reason is {reason}")
    said = int(reason.rsplit(" is not finite at ", 1)[1].split()[0])
    expect(step <= said <= step + _KINDS[kind], f"{what}: seen at {said} only")
    path = records[1].path
    last = Checkpoints(path, records[1].run_id).latest(count_jsonl(path / METRICS))
    if step > 2 * INTERVAL:
        expect(last is not None, f"{what}: no checkpoint is kept")
    if last is not None:
        finite = all(bool(t.isfinite().all()) for t in last.state.values())
        expect(finite and last.counters.env_steps <= step, f"{what}: the checkpoint is spoilt")
    for line in (path / METRICS).read_text().splitlines():
        json.loads(line, parse_constant=lambda word: expect(False, f"{word} in the log"))


def _spoil(rng: Random, kind: str, step: int, bad: float) -> Callable[[], None]:
    """What makes something of the first run bad, when it has trained so far."""
    choice = rng.random()

    def patch() -> None:
        advance = Training.advance
        play, add = autoreset.play, RunningMeans.add
        now = [False]

        def spoilt(training: Training) -> None:
            now[0] = training.env_steps + GAMES == step and training.streams._seeds[0] == 1
            advance(training)
            if now[0] and kind in ("gradient", "number"):
                _spoil_weights(training, choice, None if kind == "gradient" else bad)

        def spoilt_reward(*arguments: Any) -> Any:
            before, transition = play(*arguments)
            if now[0] and kind == "reward":
                transition.reward.view(-1)[int(choice * transition.reward.numel())] = bad
            return before, transition

        def spoilt_loss(means: RunningMeans, loss: Tensor, q: Tensor) -> None:
            add(means, loss * bad if now[0] and kind == "loss" else loss, q)

        Training.advance = spoilt  # type: ignore[method-assign, assignment]
        RunningMeans.add = spoilt_loss  # type: ignore[method-assign, assignment]
        autoreset.play = spoilt_reward  # type: ignore[assignment]

    return patch


def _spoil_weights(training: Training, choice: float, bad: float | None) -> None:
    """One number of a layer or of its moments; None: what Adam makes of a gradient, inf or NaN."""
    state = state_of(training, 0)
    which = ("learner.online",) if bad is None else ("learner.online", "learner.exp")
    names = [name for name in sorted(state) if name.startswith(which)]
    tensor = state[names[int(choice * len(names))]]
    if bad is None:
        tensor[int(choice * len(tensor))] = math.nan
    else:
        tensor.view(-1)[0] = bad
