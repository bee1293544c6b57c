"""One live game of other people, and what it says in tensors."""

from typing import Any, NamedTuple

import torch
from torch import Tensor

from msgdrop_envs.foreign import factory
from msgdrop_envs.foreign.config import Config, in_its_units
from msgdrop_envs.registry import GameError


class Result(NamedTuple):
    """What one step gave beside `Live.obs`."""

    reward: Tensor
    """[N] float32."""
    over: bool
    """Nobody is left."""
    cut: bool
    """It is over by a time limit: some agent was truncated in this step."""


class Live:
    """A `ParallelEnv` between two steps."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._game = factory.make(config.factory)
        self.seed, self.steps = -1, 0
        self.obs: Tensor
        """[N, O] float32: what the agents see now, zeros for those who have left."""

    def go_to(self, seed: int, actions: Tensor) -> None:
        """Begin the episode of this seed, and do what was done in it, [steps, N] or [.., A].

        A game that ends earlier this time stands at its beginning.
        """
        self._begin(seed)
        for each in actions:
            if self.step(each).over:
                self._begin(seed)
                break
        self.steps = len(actions)

    def step(self, actions: Tensor) -> Result:
        """Play one step; actions [N] or [N, A], without those of agents who have left.

        Raises GameError for whatever goes wrong there, and for a truncation before the time limit:
        memories are laid out for it.
        """
        with factory.theirs(self._config.factory, "step() fails"):
            return self._step(actions)

    def _step(self, actions: Tensor) -> Result:
        names, playing = self._config.agent_names, set(self._game.agents)
        meant = in_its_units(self._config, actions)
        chosen = {
            name: self._action(name, action)
            for name, action in zip(names, meant, strict=True)
            if name in playing
        }
        observations, rewards, _, truncations, _ = self._game.step(chosen)
        self.steps += 1
        # Some games go on telling those who have left before; they see and get nothing.
        self._see({name: seen for name, seen in observations.items() if name in playing})
        got = {name: reward for name, reward in rewards.items() if name in playing}
        reward = torch.tensor([float(got.get(name, 0.0)) for name in names])
        over = not self._game.agents
        cut = over and any(truncations.values())
        if cut and self.steps < self._config.time_limit:
            hint = f"--set environment.time_limit={self.steps}"
            raise GameError(f"{self._config.factory}: ends after {self.steps} steps; say {hint}")
        return Result(reward, over, cut)

    def _begin(self, seed: int) -> None:
        with factory.theirs(self._config.factory, "reset() fails"):
            given = self._game.reset(seed=seed)
            if not isinstance(given, tuple) or len(given) != 2:
                raise GameError(f"{self._config.factory}: reset() gives no observations and infos")
            self._see(given[0])
        self.seed, self.steps = seed, 0

    def _see(self, observations: Any) -> None:
        config = self._config
        if strange := sorted(set(self._game.agents) - set(config.agent_names)):
            raise GameError(f"{config.factory}: {strange[0]!r} is none of its possible_agents")
        obs = torch.zeros(len(config.agent_names), config.observation_size)
        for row, name in zip(obs, config.agent_names, strict=True):
            if name in observations:
                seen = torch.tensor(observations[name], dtype=torch.float32).flatten()
                if seen.shape != row.shape:
                    says = f"{name} sees {len(seen)} numbers, expected {len(row)}"
                    raise GameError(f"{config.factory}: {says}; is it another version?")
                row.copy_(seen)
        self.obs = obs

    def _action(self, name: str, action: Tensor) -> Any:
        """An action in the game's own type."""
        if self._config.actions:
            return int(action)
        space = self._game.action_space(name)
        return action.numpy().astype(space.dtype).reshape(space.shape)
