"""A control: in place of each message an agent hears what it would say itself."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, nothing_lost


@dataclass(frozen=True, slots=True)
class Own(Kind):
    """What policies lose by it is what they owe to others; what stays is the size of the inputs."""

    example: ClassVar[tuple[float, ...]] = ()
    whole: ClassVar[bool] = False

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """Its own, now."""
        age = nothing_lost(scene)
        agents = torch.arange(scene.agents, device=age.device)[:, None]
        return Arriving(age, state, speaker=agents.expand(age.shape))
