"""Agents that hear those who are nearest, whoever that is in a step."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, check_at_most, check_whole, lost_where
from msgdrop_cli.channels.within import distances


@dataclass(frozen=True, slots=True)
class Nearest(Kind):
    """Each agent hears so many others; of equally near ones those with the lower numbers."""

    example: ClassVar[tuple[float, ...]] = (2.0,)
    needs_positions: ClassVar[bool] = True
    heard: float
    """How many, at most all others."""

    def __post_init__(self) -> None:
        check_whole("the number of agents that are heard", self.heard, 0, 255)

    def check(self, agents: int) -> None:
        """There must be so many others."""
        check_at_most("the number of agents that are heard", self.heard, agents - 1, agents)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """The rest is not heard."""
        rank = distances(scene).argsort(dim=-1, stable=True).argsort(-1)  # [..., N, S]
        return Arriving(lost_where(rank >= self.heard), state)
