"""Simple ways to play waterworld catch what the throw-away trials caught: the game is that game."""

import dataclasses
from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from msgdrop_envs.waterworld import PAPER, Config, State
from tests.waterworld_positions import build

GAMES = 16
Policy = Callable[[State, torch.Generator], Tensor]


def episode(policy: Policy, config: Config = PAPER["waterworld-n8"]) -> dict[str, float]:
    """What happens in 500 steps, the mean of some games."""
    env, generator = build(config), torch.Generator().manual_seed(0)
    state = env.reset(torch.rand(GAMES, env.reset_uniforms, generator=generator))
    happened = dict.fromkeys(env.counts, 0.0)
    for _ in range(500):
        uniforms = torch.rand(GAMES, env.step_uniforms, generator=generator)
        state, transition = env.step(state, policy(state, generator), uniforms)
        for name, count in transition.info.items():
            happened[name] += count.mean().item()
    return happened


def steer(state: State, goal: Tensor) -> Tensor:
    """Actions that bring all pursuers to a place; goal: [B, 1, 2] or [2]."""
    away = goal - state.positions[:, :8]
    return (20 * away - 60 * state.velocities[:, :8]).clamp(-1, 1)


def to_nearest_food(state: State, _: torch.Generator) -> Tensor:
    """All go to the food nearest to their middle: it needs to see everything."""
    food = state.positions[:, 8:18]
    middle = state.positions[:, :8].mean(1, keepdim=True)
    nearest = (food - middle).norm(dim=-1).argmin(1)
    return steer(state, food[torch.arange(GAMES), nearest][:, None])


def at_random(_: State, generator: torch.Generator) -> Tensor:
    """Every action anew, anywhere in the square of actions."""
    return torch.rand(GAMES, 8, 2, generator=generator) * 2 - 1


@pytest.mark.parametrize(
    ("policy", "least", "most"),
    [
        (at_random, 0.0, 0.0),
        (lambda state, _: torch.zeros(GAMES, 8, 2), 0.0, 0.0),
        (lambda state, _: steer(state, torch.tensor([0.15, 0.5])), 0.5, 3.0),
        (to_nearest_food, 51.0, 93.0),
    ],
    ids=["random", "nothing", "one place", "nearest food"],
)
def test_reference_policies_catch_what_the_trials_caught(
    policy: Policy, least: float, most: float
) -> None:
    """Trials: 0.00 at random or doing nothing, 1.9 at one place, 51 to 93 at the nearest food."""
    assert least <= episode(policy)["catches"] <= most


@pytest.mark.parametrize(("catchers", "least", "most"), [(1, 75.0, 95.0), (2, 2.0, 6.0)])
def test_cooperation_is_what_makes_it_hard(catchers: int, least: float, most: float) -> None:
    """Trials, at random: 86 catches if one pursuer were enough, 4 if two were."""
    easier = dataclasses.replace(PAPER["waterworld-n8"], catchers=catchers)
    assert least <= episode(at_random, easier)["catches"] <= most
