"""Tiny PettingZoo games of somebody else; each class is a factory, `tests.somebodys_game:Echo`."""

from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Discrete, Space
from pettingzoo import ParallelEnv

Rows = dict[str, Any]


class Echo(ParallelEnv):  # type: ignore[misc]  # it ships no types
    """Each of three agents is shown a bit, and is rewarded for saying its left neighbour's."""

    metadata = {"name": "echo_v0"}  # noqa: RUF012 - as PettingZoo has it
    agents: list[str]

    def __init__(self, max_cycles: int = 5) -> None:
        self.possible_agents = ["red", "green", "blue"]
        self.agents, self.max_cycles = [], max_cycles
        self.rng = np.random.default_rng(0)

    def observation_space(self, agent: str) -> Space[Any]:
        """Own bit, and the share of the episode that is over, as a 2x1 picture."""
        return Box(0.0, 1.0, (2, 1), np.float32)

    def action_space(self, agent: str) -> Space[Any]:
        """The bit."""
        return Discrete(2)

    def reset(self, seed: int | None = None, options: object = None) -> tuple[Rows, Rows]:
        """Begin."""
        if seed is not None:
            self.rng = np.random.default_rng(seed)
        self.agents, self.elapsed = list(self.possible_agents), 0
        return self.seen(), {agent: {} for agent in self.agents}

    def seen(self) -> Rows:
        """New bits."""
        self.bits = self.rng.integers(2, size=len(self.possible_agents))
        share = self.elapsed / self.max_cycles
        rows = zip(self.possible_agents, self.bits, strict=True)
        return {
            agent: np.array([[bit], [share]], np.float32)
            for agent, bit in rows
            if agent in self.agents
        }

    def gains(self, actions: Rows) -> Rows:
        """A reward for each right bit."""
        left = dict(zip(self.possible_agents, np.roll(self.bits, 1), strict=True))
        return {agent: float(actions[agent] == left[agent]) for agent in self.agents}

    def step(self, actions: Rows) -> tuple[Rows, Rows, Rows, Rows, Rows]:
        """Play."""
        assert set(actions) == set(self.agents), actions
        assert all(self.action_space(agent).contains(a) for agent, a in actions.items()), actions
        rewards = self.gains(actions)
        self.elapsed += 1
        playing, gone = list(self.agents), set(self.leaving())
        cut = self.elapsed >= self.max_cycles
        seen = self.seen()
        self.agents = [] if cut else [agent for agent in playing if agent not in gone]
        ended = {agent: agent in gone for agent in playing}
        truncated = {agent: cut and agent not in gone for agent in playing}
        return seen, rewards, ended, truncated, {agent: {} for agent in playing}

    def leaving(self) -> list[str]:
        """Who ends by itself in this step."""
        return []


class Push(Echo):
    """The same with numbers: each says two from -1 to 3, and the nearer to 1 the better."""

    def action_space(self, agent: str) -> Space[Any]:
        """Two numbers."""
        return Box(-1.0, 3.0, (2,), np.float32)

    def gains(self, actions: Rows) -> Rows:
        """At most 0."""
        return {agent: -float(abs(actions[agent] - 1.0).sum()) for agent in self.agents}


class Leaving(Echo):
    """Red leaves after two steps, the others after four."""

    def leaving(self) -> list[str]:
        """By the clock."""
        return {2: ["red"], 4: ["green", "blue"]}.get(self.elapsed, [])


class Gossip(Leaving):
    """It goes on telling those who have left."""

    def seen(self) -> Rows:
        """Everybody sees ones."""
        return {agent: np.ones((2, 1), np.float32) for agent in self.possible_agents}

    def gains(self, actions: Rows) -> Rows:
        """Everybody gets one."""
        return dict.fromkeys(self.possible_agents, 1.0)


class Restless(Echo):
    """Its bits come from nowhere: it does not repeat itself."""

    def reset(self, seed: int | None = None, options: object = None) -> tuple[Rows, Rows]:
        """Begin whatever the seed."""
        return super().reset()


class Shorter(Echo):
    """Its first episodes last longer than the others."""

    def reset(self, seed: int | None = None, options: object = None) -> tuple[Rows, Rows]:
        """Begin."""
        self.max_cycles = 5 if seed is not None and seed < 5 else 3
        return super().reset(seed)


class Tables(Echo):
    """It shows dictionaries."""

    def observation_space(self, agent: str) -> Space[Any]:
        """Of one number."""
        return Dict({"bit": Box(0.0, 1.0, (1,))})


class Unlike(Echo):
    """Blue has more to choose from."""

    def action_space(self, agent: str) -> Space[Any]:
        """Two or three."""
        return Discrete(3 if agent == "blue" else 2)


class Unbounded(Echo):
    """Its numbers have no end."""

    def action_space(self, agent: str) -> Space[Any]:
        """Any number."""
        return Box(-np.inf, np.inf, (1,))


class Joining(Echo):
    """Somebody comes along."""

    def step(self, actions: Rows) -> tuple[Rows, Rows, Rows, Rows, Rows]:
        """Play, and let in another one."""
        result = super().step(actions)
        self.agents.append("white")
        return result


class Broken(Echo):
    """It cannot be made."""

    def __init__(self) -> None:
        raise SystemError("two\n lines")


class Leaves(Echo):
    """It would end the program."""

    def __init__(self) -> None:
        raise SystemExit("no display")


class Stumbles(Echo):
    """Its second step fails."""

    def step(self, actions: Rows) -> tuple[Rows, Rows, Rows, Rows, Rows]:
        """Play, once."""
        assert self.elapsed == 0, "not a second time"
        return super().step(actions)


class Talks(Echo):
    """It says what it does."""

    def __init__(self) -> None:
        super().__init__()
        print("a game is made")

    def step(self, actions: Rows) -> tuple[Rows, Rows, Rows, Rows, Rows]:
        """Play, and say so."""
        print("a step")
        return super().step(actions)


def nobody() -> object:
    """No game at all."""
    return object()
