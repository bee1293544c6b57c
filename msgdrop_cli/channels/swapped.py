"""A control: everybody hears all others, but does not know who is who."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, by_message, nothing_lost, others


@dataclass(frozen=True, slots=True)
class Swapped(Kind):
    """What policies lose by it is what they owe to knowing who said what.

    The senders of each agent are put in a random order, anew at every step.
    """

    example: ClassVar[tuple[float, ...]] = ()
    whole: ClassVar[bool] = False

    def step_uniforms(self, agents: int) -> int:
        """One for each message, to be sorted by."""
        return agents * (agents - 1)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """Another order for every agent."""
        order = by_message(uniforms, scene.agents).argsort(-1)
        speakers = others(scene.agents, uniforms.device).expand_as(order).gather(-1, order)
        return Arriving(nothing_lost(scene), state, speaker=speakers)
