"""Each message may be lost, by itself and at every step: an erasure channel without memory."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, by_message, check_share, lost_where


@dataclass(frozen=True, slots=True)
class Loss(Kind):
    """What message-dropout does to what is learnt from, done to what agents act by."""

    example: ClassVar[tuple[float, ...]] = (0.2,)
    rate: float
    """The probability that a message is lost."""

    def __post_init__(self) -> None:
        check_share("the rate of loss", self.rate)

    def step_uniforms(self, agents: int) -> int:
        """One for each message."""
        return agents * (agents - 1)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """A number below the rate loses its message."""
        return Arriving(lost_where(by_message(uniforms, scene.agents) < self.rate), state)
