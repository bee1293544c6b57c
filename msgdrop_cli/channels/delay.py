"""Messages that come late: what arrives was said some steps ago."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, check_whole, nothing_lost
from msgdrop_cli.definition.traces import OLDEST


@dataclass(frozen=True, slots=True)
class Delay(Kind):
    """Every message takes so many steps; nothing arrives before the first one does."""

    example: ClassVar[tuple[float, ...]] = (2.0,)
    steps: float
    """From 0, at most 100."""

    def __post_init__(self) -> None:
        check_whole("the delay in steps", self.steps, 0, OLDEST)

    @property
    def oldest(self) -> int:
        """The delay."""
        return int(self.steps)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """The same age everywhere."""
        return Arriving(nothing_lost(scene) + self.oldest, state)
