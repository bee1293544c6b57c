"""Broken links, drawn anew at every step: the other reading of the paper's test (l. 525)."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, check_share
from msgdrop_cli.channels.links import broken_links


@dataclass(frozen=True, slots=True)
class LinksStep(Kind):
    """Exactly this share of the links is broken in every step, both directions together."""

    example: ClassVar[tuple[float, ...]] = (0.5,)
    share: float
    """Of the links, i.e. unordered pairs of agents."""

    def __post_init__(self) -> None:
        check_share("the share of broken links", self.share)

    def step_uniforms(self, agents: int) -> int:
        """One number orders each link, the last one rounds."""
        return agents * (agents - 1) // 2 + 1

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """Other links than before."""
        return Arriving(broken_links(uniforms, self.share, scene.agents), state)
