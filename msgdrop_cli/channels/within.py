"""Agents that hear each other only if they are near."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, lost_where, others


@dataclass(frozen=True, slots=True)
class Within(Kind):
    """A message arrives if its sender is no farther away than this, in this step."""

    example: ClassVar[tuple[float, ...]] = (5.0,)
    needs_positions: ClassVar[bool] = True
    distance: float
    """Euclidean, in the game's unit: cells of pursuit, navigation's units (its square has sides of
    2), sides of waterworld's square."""

    def __post_init__(self) -> None:
        if not self.distance >= 0:
            raise ValueError(f"the distance must not be negative, not {self.distance:g}")

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """Who is too far away is not heard."""
        return Arriving(lost_where(distances(scene) > self.distance), state)


def distances(scene: Scene) -> Tensor:
    """From each agent to its senders, [..., N, S], in the game's unit."""
    where = scene.positions
    assert where is not None
    ways = where[..., others(scene.agents, where.device), :] - where[..., None, :]
    return ways.square().sum(-1).sqrt()
