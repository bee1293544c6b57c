"""An encoder for the tests: eleven weighted sums of what is seen, which are learnt."""

from collections.abc import Mapping

import torch
from torch import Tensor

from msgdrop_cli.messages.encoders import Weights

WIDTH = 11
"""Wider than some of the tests' observations, narrower than others."""


def width(observation: int) -> int:
    """Whatever is seen."""
    return WIDTH


def layers(observation: int) -> Mapping[str, tuple[int, int]]:
    """One layer."""
    return {"sketch": (observation, WIDTH)}


def message(weights: Weights, obs: Tensor) -> Tensor:
    """No ReLU: messages may be negative."""
    weight, bias = weights["sketch"]
    return torch.baddbmm(bias, obs.float(), weight)


def decoder(observation: int) -> Mapping[str, tuple[int, int]]:
    """One layer back."""
    return {"back": (WIDTH, observation)}


def reconstruction(weights: Weights, said: Tensor) -> Tensor:
    """Linear, so that it can be no better than the largest principal components."""
    weight, bias = weights["back"]
    return torch.baddbmm(bias, said, weight)
