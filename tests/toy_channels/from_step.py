"""A channel for the tests: the first messages of an episode are lost, all others arrive."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, lost_where


@dataclass(frozen=True, slots=True)
class FromStep(Kind):
    """Counts the steps of each game."""

    example: ClassVar[tuple[float, ...]] = (3.0,)
    first: float
    """Steps before the first message arrives."""

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """Steps so far, [..., 1]."""
        return uniforms.new_zeros(*uniforms.shape[:-1], 1)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """One step more."""
        lost = lost_where(state < self.first)[..., None]
        age = lost.expand(*state.shape[:-1], scene.agents, scene.agents - 1)
        return Arriving(age, state + 1)
