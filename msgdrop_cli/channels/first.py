"""Messages that stop: only those of an episode's first steps arrive."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, check_whole, lost_where, nothing_lost


@dataclass(frozen=True, slots=True)
class First(Kind):
    """With a receiver that holds the last one, messages are constant (the channel `constant`)."""

    example: ClassVar[tuple[float, ...]] = (3.0,)
    steps: float
    """How many steps."""

    def __post_init__(self) -> None:
        check_whole("the number of steps", self.steps, 0, 1_000_000)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """All or nothing."""
        over = lost_where(scene.elapsed >= self.steps)[..., None, None]  # [..., 1, 1]
        return Arriving(nothing_lost(scene) + over, state)
