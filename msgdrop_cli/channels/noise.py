"""Messages whose numbers arrive with noise on them."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, nothing_lost

_MOST = 1e6
"""More would leave float32 behind."""


@dataclass(frozen=True, slots=True)
class Noise(Kind):
    """Gaussian noise of this standard deviation is added to every number that an agent sends.

    It arises at the sender: all who hear an agent in a step hear the same.
    """

    example: ClassVar[tuple[float, ...]] = (0.5,)
    deviation: float
    """In the unit of the observation."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.deviation <= _MOST:
            raise ValueError(f"the deviation must lie between 0 and 1e6, not {self.deviation:g}")

    def message_uniforms(self, size: int) -> int:
        """One for each number."""
        return size if self.deviation else 0

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """Everything arrives."""
        return Arriving(nothing_lost(scene), state)

    def alter(self, messages: Tensor, uniforms: Tensor) -> Tensor:
        """The inverse of the normal distribution function; at 0 it would be infinite."""
        normal: Tensor = torch.special.ndtri(uniforms.clamp(min=2.0**-25))
        return messages + self.deviation * normal
