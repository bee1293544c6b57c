"""The links whose loss hurts a policy most, broken from the first step to the last."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import (
    Arriving,
    Kind,
    Scene,
    by_message,
    check_at_most,
    check_whole,
    lost_where,
)


@dataclass(frozen=True, slots=True)
class Worst(Kind):
    """So many links, found one after the other on episodes of their own (engine/worst_links.py).

    What the start of an episode takes is no random numbers here: 1 for each message that is lost.
    """

    example: ClassVar[tuple[float, ...]] = (1.0,)
    links: float
    """How many, both directions of each, at most as many as there are."""

    def __post_init__(self) -> None:
        check_whole("the number of links", self.links, 0, 255)

    def check(self, agents: int) -> None:
        """There must be so many."""
        most = agents * (agents - 1) // 2
        check_at_most("the number of links", self.links, most, agents)

    @property
    def links_to_find(self) -> int:
        """How many links the engine is asked for."""
        return int(self.links)

    def episode_uniforms(self, agents: int) -> int:
        """One for each message."""
        return agents * (agents - 1)

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """The ages of the whole episode, [..., N, S] uint8."""
        return by_message(lost_where(uniforms >= 1.0), agents)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """The same again."""
        return Arriving(age=state, state=state)
