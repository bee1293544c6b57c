"""Losses that come in bursts: a Gilbert-Elliott chain for each directed link.

Gilbert: Capacity of a burst-noise channel, Bell System Technical Journal 39 (1960); Elliott 1963.
"""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, by_message, lost_where


@dataclass(frozen=True, slots=True)
class Bursts(Kind):
    """In the good state every message arrives, in the bad one none does; it begins anywhere."""

    example: ClassVar[tuple[float, ...]] = (0.2, 4.0)
    mean_loss: float
    """The share of messages that is lost in the long run, and in each step."""
    mean_length: float
    """Steps that a burst of losses lasts, on average; geometric."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.mean_loss < 1.0:
            raise ValueError(
                f"the mean loss must be at least 0 and below 1, not {self.mean_loss:g}"
            )
        if not self.mean_length >= 1.0:
            raise ValueError(f"a burst lasts at least 1 step, not {self.mean_length:g}")
        if not self._begins <= 1.0:
            least = self.mean_loss / (1.0 - self.mean_loss)
            raise ValueError(
                f"bursts of {self.mean_length:g} steps cannot lose {self.mean_loss:g}:"
                f" take at least {least:g} steps"
            )

    @property
    def _begins(self) -> float:
        """The probability that a good link turns bad."""
        return self.mean_loss / (1.0 - self.mean_loss) / self.mean_length

    def episode_uniforms(self, agents: int) -> int:
        """One for each message: how its link begins."""
        return agents * (agents - 1)

    def step_uniforms(self, agents: int) -> int:
        """One for each message: whether its link changes."""
        return agents * (agents - 1)

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """Whether a link is bad, [..., N, S] bool, as often as in the long run."""
        return by_message(uniforms, agents) < self.mean_loss

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """What the state says; then it may change."""
        numbers = by_message(uniforms, scene.agents)
        ends, begins = numbers < 1.0 / self.mean_length, numbers < self._begins
        return Arriving(lost_where(state), (state & ~ends) | (~state & begins))
