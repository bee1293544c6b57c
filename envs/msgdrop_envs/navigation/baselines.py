"""Policies of navigation that learn nothing, for tables and figures. No rules here."""

from collections.abc import Mapping

import torch
from torch import Tensor

from msgdrop_envs.navigation.rules import DAMPING, DT, PUSHES, SENSITIVITY, Navigation, State
from msgdrop_envs.protocol import Baseline, random_play

AHEAD = 4
"""Steps that the scripted policy looks ahead."""


def baselines(game: Navigation) -> Mapping[str, Baseline]:
    """Random play, never pushing, and a look a few steps ahead."""
    return {
        "random": random_play(game),
        "nothing": Baseline(_nothing, "nobody pushes"),
        "scripted": Baseline(
            lambda state, uniforms: _look_ahead(game, state),
            f"seeing everybody, each makes the push whose next {AHEAD} steps cost it least",
        ),
    }


def _nothing(state: State, uniforms: Tensor) -> Tensor:
    return torch.zeros(uniforms.shape[:-1], dtype=torch.int64, device=uniforms.device)


def _look_ahead(game: Navigation, state: State) -> Tensor:
    """The best push [..., N] if afterwards all coast, contact forces left out.

    The cost of a step is the reward's: the distance to the nearest landmark, and the penalty for
    each other agent in contact.
    """
    config = game.config
    pushes = DT * SENSITIVITY * torch.tensor(PUSHES, device=state.positions.device)  # [A, 2]
    others, other_speed = state.positions, state.velocities  # [..., N, 2]
    mine = state.positions[..., None, :]  # [..., N, 1, 2], then [..., N, A, 2]
    speed = (1.0 - DAMPING) * state.velocities[..., None, :] + pushes  # [..., N, A, 2]
    apart = ~torch.eye(game.agents, dtype=torch.bool, device=pushes.device)[:, None]  # [N, 1, N]
    cost = torch.zeros(speed.shape[:-1], device=pushes.device)  # [..., N, A]
    for _ in range(AHEAD):
        mine = mine + DT * speed
        speed = (1.0 - DAMPING) * speed
        other_speed = (1.0 - DAMPING) * other_speed
        others = others + DT * other_speed
        away = (mine[..., None, :] - others[..., None, None, :, :]).square().sum(-1)
        touching = (away < (2.0 * config.agent_radius) ** 2) & apart  # [..., N, A, N]
        far = (mine[..., None, :] - state.landmarks[..., None, None, :, :]).square().sum(-1)
        cost = cost + far.amin(-1).sqrt() + config.collision_penalty * touching.sum(-1)
    return cost.argmin(-1)
