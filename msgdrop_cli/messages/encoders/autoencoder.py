"""Messages of 32 numbers: the first half of an autoencoder 147-64-32-64-147 (paper l. 786-790).

It is pretrained to say what is seen again, and then stays as it is (`engine/pretraining.py`). Drawn
in the paper's figure are two layers on each side and 32 in the middle; 64 between them is ours, and
so is the ReLU on all but the last layer of each half, as everywhere in the paper (l. 749).
"""

from collections.abc import Mapping

import torch
from torch import Tensor

from msgdrop_cli.messages.encoders import Weights

HIDDEN, MESSAGE = 64, 32


def width(observation: int) -> int:
    """As drawn, whatever is seen."""
    return MESSAGE


def layers(observation: int) -> Mapping[str, tuple[int, int]]:
    """The encoder's."""
    return {"encode1": (observation, HIDDEN), "encode2": (HIDDEN, MESSAGE)}


def decoder(observation: int) -> Mapping[str, tuple[int, int]]:
    """The other half's, which nobody needs after the pretraining."""
    return {"decode1": (MESSAGE, HIDDEN), "decode2": (HIDDEN, observation)}


def message(weights: Weights, obs: Tensor) -> Tensor:
    """The code [R, rows, 32] of obs [R, rows, O]."""
    return _half(weights, "encode", obs.float())


def reconstruction(weights: Weights, said: Tensor) -> Tensor:
    """What was seen, as far as a message tells: [R, rows, O] of said [R, rows, 32]."""
    return _half(weights, "decode", said)


def _half(weights: Weights, half: str, x: Tensor) -> Tensor:
    """Two layers, a ReLU between them."""
    (first, first_bias), (second, second_bias) = weights[f"{half}1"], weights[f"{half}2"]
    return torch.baddbmm(second_bias, torch.baddbmm(first_bias, x, first).relu(), second)
