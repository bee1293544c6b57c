"""A control: messages of the right sender and step, but of another episode."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, nothing_lost


@dataclass(frozen=True, slots=True)
class Shuffled(Kind):
    """What policies lose by it is what they owe to messages that are about their own game.

    Each game hears its neighbour among those that are still played; the last one hears itself.
    """

    example: ClassVar[tuple[float, ...]] = ()
    whole: ClassVar[bool] = False

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """The next game's."""
        games = torch.arange(scene.elapsed.shape[-1], device=uniforms.device).roll(-1)
        return Arriving(nothing_lost(scene), state, game=games.expand(scene.elapsed.shape))
