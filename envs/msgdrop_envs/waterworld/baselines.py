"""Policies of waterworld that learn nothing, for tables and figures. No rules here."""

from collections.abc import Mapping

import torch
from torch import Tensor

from msgdrop_envs.protocol import Baseline, random_play
from msgdrop_envs.waterworld.rules import State, Waterworld

MEETING_PLACE = (0.15, 0.5)
"""Between the obstacle and a wall."""


def baselines(game: Waterworld) -> Mapping[str, Baseline]:
    """Random play, doing nothing, meeting at one place, and hunting together."""
    return {
        "random": random_play(game),
        "nothing": Baseline(_nothing, "nobody pushes"),
        "one place": Baseline(
            lambda state, uniforms: _steer(game, state, _meeting_place(state)),
            "all go to one fixed place and wait there",
        ),
        "scripted": Baseline(
            lambda state, uniforms: _steer(game, state, _nearest_food(game, state)),
            "seeing everything, all go to the food nearest to their middle",
        ),
    }


def _nothing(state: State, uniforms: Tensor) -> Tensor:
    return torch.zeros_like(uniforms)


def _meeting_place(state: State) -> Tensor:
    return torch.tensor(MEETING_PLACE, device=state.positions.device)


def _nearest_food(game: Waterworld, state: State) -> Tensor:
    """The place [..., 1, 2] of the food nearest to the middle of all pursuers."""
    food = state.positions[..., game.agents : game.agents + game.config.food, :]
    middle = state.positions[..., : game.agents, :].mean(-2, keepdim=True)
    nearest = (food - middle).square().sum(-1).argmin(-1)[..., None, None]
    return food.gather(-2, nearest.expand(*nearest.shape[:-1], 2))


def _steer(game: Waterworld, state: State, goal: Tensor) -> Tensor:
    """Pushes [..., N, 2] that bring all pursuers to a place, and to rest there."""
    away = goal - state.positions[..., : game.agents, :]
    return (20.0 * away - 60.0 * state.velocities[..., : game.agents, :]).clamp(-1.0, 1.0)
