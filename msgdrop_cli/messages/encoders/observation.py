"""Agents say what they see: m^(i,j) = o^j (paper l. 289-290)."""

from collections.abc import Mapping

from torch import Tensor

from msgdrop_cli.messages.encoders import Weights


def width(observation: int) -> int:
    """All of it."""
    return observation


def layers(observation: int) -> Mapping[str, tuple[int, int]]:
    """Nothing is learnt."""
    return {}


def message(weights: Weights, obs: Tensor) -> Tensor:
    """The observations as numbers, [R, rows, O]."""
    return obs.float()
