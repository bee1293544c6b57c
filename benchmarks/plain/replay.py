"""The joint transitions of all agents in a ring."""

from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.plain.game import Array, Game

BATCH = 32


class Replay:
    """obs and next_obs [capacity, N, O], actions [capacity, N] or [capacity, N, A], and so on."""

    def __init__(self, game: Game, capacity: int, rng: np.random.Generator) -> None:
        self.rng = rng
        self.capacity = capacity
        self.obs: Array = np.empty((capacity, game.agents, game.observation), game.dtype)
        self.next_obs = np.empty_like(self.obs)
        if game.actions:
            self.actions: Array = np.empty((capacity, game.agents), np.int64)
        else:
            self.actions = np.empty((capacity, game.agents, game.action_size), np.float32)
        self.rewards = np.empty((capacity, game.agents), np.float32)
        self.discount = np.empty(capacity, np.float32)
        self.added = 0

    def add(self, obs: Array, actions: Any, rewards: Any, next_obs: Array, discount: float) -> None:
        """Store one joint transition over the oldest one."""
        row = self.added % self.capacity
        self.obs[row] = obs
        self.next_obs[row] = next_obs
        self.actions[row] = actions
        self.rewards[row] = rewards
        self.discount[row] = discount
        self.added += 1

    def draw(self) -> npt.NDArray[np.int64]:
        """The rows of a minibatch: [B]."""
        return self.rng.integers(min(self.added, self.capacity), size=BATCH)
