"""A channel for the tests: the first messages of an episode are lost, all others arrive."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving


@dataclass(frozen=True, slots=True)
class FromStep:
    """Counts the steps of each game."""

    example: ClassVar[tuple[float, ...]] = (3.0,)
    first: float
    """Steps before the first message arrives."""

    def episode_uniforms(self, agents: int) -> int:
        """None."""
        return 0

    def step_uniforms(self, agents: int) -> int:
        """None."""
        return 0

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """Steps so far, [..., 1]."""
        return uniforms.new_zeros(*uniforms.shape[:-1], 1)

    def step(self, state: Tensor, uniforms: Tensor, agents: int) -> Arriving:
        """One step more."""
        arrives = (state >= self.first).float()[..., None]
        return Arriving(keep=arrives.expand(*state.shape[:-1], agents, agents - 1), state=state + 1)
