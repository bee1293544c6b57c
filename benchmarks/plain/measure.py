"""How fast the plain implementation trains: `python -m benchmarks.plain.measure [ENVIRONMENT]`."""

import json
import sys
import time

import numpy as np
import torch

from benchmarks.plain.dqn import QLearners, Units
from benchmarks.plain.game import Game
from benchmarks.plain.maddpg import MADDPG
from benchmarks.plain.navigation import Navigation
from benchmarks.plain.pursuit import Pursuit
from benchmarks.plain.stopwatch import Stopwatch
from benchmarks.plain.training import Learner, Training
from benchmarks.plain.waterworld import Waterworld

Q_LEARNERS = ("fdc", "dcc", "dcc-md")
CASES = {
    "pursuit-n6": Q_LEARNERS,
    "pursuit-n8": Q_LEARNERS,
    "navigation-n8": Q_LEARNERS,
    "waterworld-n8": ("ddpg", "vanilla-maddpg", "maddpg", "maddpg-md"),
}
"""Environment: the algorithms that learn it."""
WARM_ENV_STEPS = 10_000
"""Random transitions in the replay before the clock starts."""
BLOCK_ENV_STEPS = 20
"""Env steps between two looks at the clock: whole updates of every learner."""


def game(environment: str, rng: np.random.Generator) -> Game:
    """One game of the paper's sizes (l. 373, 381, 394)."""
    if environment == "navigation-n8":
        return Navigation(8, rng)
    if environment == "waterworld-n8":
        return Waterworld(8, 4, rng)
    return Pursuit(6, 15, rng) if environment == "pursuit-n6" else Pursuit(8, 17, rng)


def learner(environment: str, algorithm: str, game: Game, rng: np.random.Generator) -> Learner:
    """All agents' networks, with the sizes of the paper (l. 745-772)."""
    if environment == "waterworld-n8":
        return MADDPG(game, algorithm, rng)
    pursuit_units = Units((64, 48), 96 if environment == "pursuit-n6" else 128)
    units = Units((64, 64), 64) if environment == "navigation-n8" else pursuit_units
    return QLearners(game, algorithm, units, rng)


def prepared(environment: str, algorithm: str, seed: int = 1) -> Training:
    """A training whose replay is filled and whose code is warm."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    one = game(environment, rng)
    training = Training(one, learner(environment, algorithm, one, rng), rng)
    training.warm_up(WARM_ENV_STEPS)
    for _ in range(5 * BLOCK_ENV_STEPS):
        training.env_step()
    return training


def measure(training: Training, seconds: float) -> dict[str, float]:
    """Train for `seconds` on the thread that torch has been left, and say where the time went.

    Returns env_steps_per_s, and act, step, sample, update in ms per env step (an update's cost is
    spread over the env steps that it serves).
    """
    training.watch = Stopwatch()
    first, start = training.env_steps, time.perf_counter()
    while time.perf_counter() - start < seconds:
        for _ in range(BLOCK_ENV_STEPS):
            training.env_step()
    wall = time.perf_counter() - start
    steps = training.env_steps - first
    parts = {part: 1e3 * spent / steps for part, spent in training.watch.seconds.items()}
    return {"env_steps_per_s": steps / wall, **parts}


if __name__ == "__main__":
    torch.set_num_threads(1)
    for name in sys.argv[1:] or CASES:
        for each in CASES[name]:
            speed = measure(prepared(name, each), seconds=10.0)
            rounded = {part: round(number, 4) for part, number in speed.items()}
            print(json.dumps({"environment": name, "algorithm": each, **rounded}))
