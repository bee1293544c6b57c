"""The order of numbers in which waterworld is played: coordinates first, games last."""

import math

import torch
from torch import Tensor


def games_last(tensor: Tensor) -> Tensor:
    """[..., E, 2] as [2, E, games]: a packed copy, always, since `step` writes into it."""
    *batch, entities, axes = tensor.shape
    planes = tensor.reshape(math.prod(batch), entities, axes).permute(2, 1, 0)
    return planes.clone(memory_format=torch.contiguous_format)


def games_first(planes: Tensor, batch: torch.Size) -> Tensor:
    """[2, E, games] as [*batch, E, 2], packed."""
    return planes.permute(2, 1, 0).contiguous().view(*batch, planes.shape[1], 2)


def dot(one: Tensor, other: Tensor) -> Tensor:
    """The products summed over the two coordinates; [2, ...] each, which may be broadcast."""
    x, y = (one * other).unbind()
    return x + y
