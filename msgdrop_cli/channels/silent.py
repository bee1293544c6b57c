"""Agents that fall silent: nobody hears them for an episode, while they hear the others."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import (
    Arriving,
    Kind,
    Scene,
    check_at_most,
    check_whole,
    lost_where,
    others,
)


@dataclass(frozen=True, slots=True)
class Silent(Kind):
    """So many agents are silent, chosen at random once an episode."""

    example: ClassVar[tuple[float, ...]] = (1.0,)
    agents: float
    """How many, at most as many as there are."""

    def __post_init__(self) -> None:
        check_whole("the number of silent agents", self.agents, 0, 255)

    def check(self, agents: int) -> None:
        """There must be so many."""
        check_at_most("the number of silent agents", self.agents, agents, agents)

    def episode_uniforms(self, agents: int) -> int:
        """One number orders each agent."""
        return agents

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """The ages of the whole episode, [..., N, S] uint8."""
        silent = uniforms.argsort(-1).argsort(-1) < self.agents  # [..., N]
        return lost_where(silent)[..., others(agents, uniforms.device)]

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """The same again."""
        return Arriving(age=state, state=state)
