"""What agents say of what they see, one file an encoder: its name in definitions is its file's.

An encoder is fixed before training begins, the same for all agents of a run. What it has learnt, if
anything, is held apart, as the weights of networks are: see `algorithms/hearing.py`.
Letters: `R` runs, `O` observation, `M` one message.
"""

from collections.abc import Mapping
from typing import Any, Protocol

from torch import Tensor

from msgdrop_cli.definition.modules import modules_in
from msgdrop_cli.errors import nearest

OBSERVATION = "observation"
"""The paper's (l. 289-290): messages are read where the observations lie, and not stored again."""
Weights = Mapping[str, tuple[Tensor, Tensor]]
"""Layer name to weight [R, inputs, outputs] and bias [R, 1, outputs]."""


class Encoder(Protocol):
    """What a file in this folder has."""

    def width(self, observation: int) -> int:
        """M, the numbers of a message about so many of an observation."""

    def layers(self, observation: int) -> Mapping[str, tuple[int, int]]:
        """What it has learnt: layer name to (inputs, outputs); empty if nothing."""

    def message(self, weights: Weights, obs: Tensor) -> Tensor:
        """The messages [R, rows, M] float32 about obs [R, rows, O]."""


class Autoencoder(Encoder, Protocol):
    """What a file has besides, if it learns: the way back."""

    def decoder(self, observation: int) -> Mapping[str, tuple[int, int]]:
        """More layers, which are learnt with the encoder's and serve nothing else."""

    def reconstruction(self, weights: Weights, said: Tensor) -> Tensor:
        """What was seen [R, rows, O], as far as the messages [R, rows, M] tell."""


def encoders() -> Mapping[str, Any]:
    """The encoders' modules by name."""
    return modules_in(__name__, __path__)


def encoder_of(name: str) -> Autoencoder:
    """The encoder that is called so; one that learns nothing is an Encoder only.

    Raises ValueError if there is none.
    """
    known = encoders()
    if name not in known:
        raise ValueError(f"encoder: none is called {name[:64]!r}; {nearest(name[:64], known)}")
    found: Autoencoder = known[name]
    return found
