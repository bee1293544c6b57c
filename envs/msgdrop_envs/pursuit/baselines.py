"""Policies of pursuit that learn nothing, for tables and figures. No rules here."""

from collections.abc import Mapping

import torch
from torch import Tensor

from msgdrop_envs.protocol import Baseline, random_play
from msgdrop_envs.pursuit.rules import MOVES, Pursuit, State

STAY = len(MOVES) - 1


def baselines(game: Pursuit) -> Mapping[str, Baseline]:
    """Random play, doing nothing, and all pursuers round one evader after the other."""
    return {
        "random": random_play(game),
        "nothing": Baseline(_nothing, "everybody stays"),
        "scripted": Baseline(
            _surround, "seeing everything, all take the sides of one evader, then of the next"
        ),
    }


def _nothing(state: State, uniforms: Tensor) -> Tensor:
    return torch.full(uniforms.shape[:-1], STAY, device=uniforms.device)


def _surround(state: State, uniforms: Tensor) -> Tensor:
    """Pursuer i goes to side i mod 4 of the first evader that is free, the longer way first."""
    moves = torch.tensor(MOVES, device=uniforms.device)
    sides = moves[torch.arange(uniforms.shape[-2], device=uniforms.device) % 4]  # [N, 2]
    first = state.free.long().argmax(-1)[..., None, None].expand(*state.free.shape[:-1], 1, 2)
    way = state.evaders.gather(-2, first) + sides - state.pursuers  # [..., N, 2]
    down, right = way.unbind(-1)
    vertical = torch.where(down < 0, 0, 3)
    horizontal = torch.where(right > 0, 1, 2)
    chosen = torch.where(down.abs() >= right.abs(), vertical, horizontal)
    return torch.where((way == 0).all(-1), STAY, chosen)
