"""The loop of both learners: act, step, store and, every few steps, an update."""

from typing import Any, Protocol

import numpy as np

from benchmarks.plain.game import Array, Game
from benchmarks.plain.replay import Replay
from benchmarks.plain.stopwatch import Stopwatch


class Learner(Protocol):
    """All agents' networks and how they learn."""

    replay: Replay
    update_every_env_steps: int

    def act(self, obs: Array) -> Any:
        """Everybody's actions in training; obs [N, O]; returns [N] or [N, A]."""

    def update(self, watch: Stopwatch) -> None:
        """One update of everything that is due."""


class Training:
    """One run."""

    def __init__(self, game: Game, learner: Learner, rng: np.random.Generator) -> None:
        self.game = game
        self.learner = learner
        self.rng = rng
        self.obs = game.reset()
        self.episode_steps = self.env_steps = 0
        self.watch = Stopwatch()

    def warm_up(self, env_steps: int) -> None:
        """Fill the replay with random play."""
        for _ in range(env_steps):
            self.play(self.random_actions())

    def env_step(self) -> None:
        """One step of the game, and the update if it is due."""
        actions = self.learner.act(self.obs)
        self.watch.lap("act")
        self.play(actions)
        self.watch.lap("step")
        if self.env_steps % self.learner.update_every_env_steps == 0:
            self.learner.update(self.watch)

    def play(self, actions: Any) -> None:
        """Play one step and store it."""
        next_obs, rewards, finished = self.game.step(actions)
        discount = 0.0 if finished else 1.0
        self.learner.replay.add(self.obs, actions, rewards, next_obs, discount)
        self.env_steps += 1
        self.episode_steps += 1
        if finished or self.episode_steps == self.game.time_limit:
            next_obs, self.episode_steps = self.game.reset(), 0
        self.obs = next_obs

    def random_actions(self) -> Any:
        """Whatever may be done."""
        if self.game.actions:
            return self.rng.integers(self.game.actions, size=self.game.agents).tolist()
        return self.rng.uniform(-1.0, 1.0, (self.game.agents, self.game.action_size))
