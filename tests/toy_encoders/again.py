"""An encoder for the tests: the observation once more, as numbers that are stored apart."""

from collections.abc import Mapping

from torch import Tensor

from msgdrop_cli.messages.encoders import Weights


def width(observation: int) -> int:
    """As wide as what is seen."""
    return observation


def layers(observation: int) -> Mapping[str, tuple[int, int]]:
    """Nothing is learnt."""
    return {}


def message(weights: Weights, obs: Tensor) -> Tensor:
    """The same numbers."""
    return obs.float()
