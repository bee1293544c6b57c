"""A channel for the tests: each message is lost by itself, at every step."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving


@dataclass(frozen=True, slots=True)
class Coin:
    """Forgets everything between two steps."""

    example: ClassVar[tuple[float, ...]] = (0.3,)
    rate: float
    """The probability that a message is lost."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.rate <= 1.0:
            raise ValueError(f"rate must lie between 0 and 1, not {self.rate}")

    def episode_uniforms(self, agents: int) -> int:
        """None."""
        return 0

    def step_uniforms(self, agents: int) -> int:
        """One for each message."""
        return agents * (agents - 1)

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """Nothing to remember, [..., 0]."""
        return uniforms

    def step(self, state: Tensor, uniforms: Tensor, agents: int) -> Arriving:
        """A number below the rate loses its message."""
        keep = (uniforms >= self.rate).float().unflatten(-1, (agents, agents - 1))
        return Arriving(keep=keep, state=state)
