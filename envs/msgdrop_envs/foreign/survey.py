"""Finds out what a factory makes: who plays, what they see and do, and how long."""

from math import isfinite
from typing import Any

import torch
from torch import Tensor

from msgdrop_envs.foreign import factory
from msgdrop_envs.foreign.config import Config
from msgdrop_envs.foreign.live import Live
from msgdrop_envs.registry import GameError

_MOST_CHOICES = 256
"""Of one agent; memories keep a byte."""
_TRIALS, _LONGEST = 5, 10_000
"""Episodes of random play that are looked at for a time limit, and their steps."""


def survey(name: str) -> Config:
    """Make a game, look at its spaces, and play it at random until it is truncated.

    The user has asked for this factory. Raises GameError, in one line, for what is no `ParallelEnv`
    or cannot be learnt here: other spaces than a flat size for all, agents of different kinds.
    """
    factory.allow(name)
    game = factory.make(name)
    with factory.theirs(name, "does not say what it is"):
        fields = _said(name, game)
    found = _time_limit(Config(**fields, time_limit=1))
    return Config(**fields, time_limit=found) if found else Config(**fields)


def _said(name: str, game: Any) -> dict[str, Any]:
    """Fields of Config that the game itself tells."""
    if not all(hasattr(game, each) for each in ("possible_agents", "step", "action_space")):
        raise GameError(f"{name}: gives a {type(game).__name__}, expected a PettingZoo ParallelEnv")
    if hasattr(game, "agent_iter"):
        raise GameError(f"{name}: gives an AECEnv, where agents take turns; make a parallel_env")
    agents = tuple(map(str, game.possible_agents))
    if not agents:
        raise GameError(f"{name}: its possible_agents are none")
    seen = _alike(name, agents, "sees", [_size(name, game, agent) for agent in agents])
    does = _alike(name, agents, "does", [_choices(name, game, agent) for agent in agents])
    return {"factory": name, "agent_names": agents, "observation_size": seen, **does}


def _size(name: str, game: Any, agent: str) -> int:
    """Numbers of a Box."""
    space = game.observation_space(agent)
    if type(space).__name__ != "Box":
        hint = "flatten it, e.g. with gymnasium.spaces.flatten"
        raise GameError(f"{name}: {agent} sees a {type(space).__name__}, expected a Box; {hint}")
    return int(torch.Size(space.shape).numel())


def _choices(name: str, game: Any, agent: str) -> dict[str, Any]:
    """Fields of Config: the number of choices, or the bounds of numbers."""
    space, kind = game.action_space(agent), type(game.action_space(agent)).__name__
    if kind == "Discrete":
        if space.start != 0 or space.n > _MOST_CHOICES:
            expected = f"0 to {_MOST_CHOICES - 1} at most"
            raise GameError(f"{name}: {agent} chooses from {space}, expected {expected}")
        return {"actions": int(space.n)}
    if kind != "Box":
        raise GameError(f"{name}: {agent} does a {kind}, expected a Discrete or a Box")
    low, high = (tuple(map(float, bound.flatten())) for bound in (space.low, space.high))
    if not all(map(isfinite, (*low, *high))):
        raise GameError(f"{name}: {agent} does numbers without bounds, which cannot be explored")
    return {"action_low": low, "action_high": high}


def _alike(name: str, agents: tuple[str, ...], verb: str, each: list[Any]) -> Any:
    """What all agents have; learners have one shape of network."""
    for agent, other in zip(agents, each, strict=True):
        if other != each[0]:
            pad = (
                "make them alike, e.g. with SuperSuit's pad_observations_v0 and pad_action_space_v0"
            )
            raise GameError(f"{name}: {agent} {verb} {other}, {agents[0]} {each[0]}; {pad}")
    return each[0]


def _time_limit(any_limit: Config) -> int | None:
    """Steps until an episode of random play is truncated; None if none is."""
    live = Live(any_limit)
    random = torch.Generator().manual_seed(1)
    for seed in range(_TRIALS):
        live.go_to(seed, torch.zeros(0))
        result = None
        while live.steps < _LONGEST and (result is None or not result.over):
            result = live.step(_any_action(any_limit, random))
        if result is not None and result.cut:
            return live.steps
    return None


def _any_action(config: Config, random: torch.Generator) -> Tensor:
    agents = len(config.agent_names)
    if config.actions:
        return torch.randint(config.actions, (agents,), generator=random)
    return torch.rand(agents, len(config.action_low), generator=random) * 2 - 1
