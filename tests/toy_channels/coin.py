"""A channel for the tests: each message is lost by itself, at every step."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, by_message, lost_where


@dataclass(frozen=True, slots=True)
class Coin(Kind):
    """Forgets everything between two steps."""

    example: ClassVar[tuple[float, ...]] = (0.3,)
    rate: float
    """The probability that a message is lost."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.rate <= 1.0:
            raise ValueError(f"rate must lie between 0 and 1, not {self.rate}")

    def step_uniforms(self, agents: int) -> int:
        """One for each message."""
        return agents * (agents - 1)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """A number below the rate loses its message."""
        return Arriving(lost_where(by_message(uniforms, scene.agents) < self.rate), state)
