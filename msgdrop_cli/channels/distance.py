"""Loss that grows with the distance between two agents."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, by_message, lost_where
from msgdrop_cli.channels.within import distances


@dataclass(frozen=True, slots=True)
class Distance(Kind):
    """A message over the distance d is lost with probability d / reach, beyond it always."""

    example: ClassVar[tuple[float, ...]] = (10.0,)
    needs_positions: ClassVar[bool] = True
    reach: float
    """In the game's unit, as for `within`."""

    def __post_init__(self) -> None:
        if not self.reach > 0:
            raise ValueError(f"the reach must be above 0, not {self.reach:g}")

    def step_uniforms(self, agents: int) -> int:
        """One for each message."""
        return agents * (agents - 1)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """Each message by itself."""
        chance = distances(scene) / self.reach
        return Arriving(lost_where(by_message(uniforms, scene.agents) < chance), state)
