"""Directed links that are broken for an episode: i may hear j while j does not hear i."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, by_message, check_share, lost_where


@dataclass(frozen=True, slots=True)
class OneWay(Kind):
    """Exactly this share of the directed links is broken, chosen at random once an episode."""

    example: ClassVar[tuple[float, ...]] = (0.5,)
    share: float
    """Of the N*S directed links."""

    def __post_init__(self) -> None:
        check_share("the share of broken links", self.share)

    def episode_uniforms(self, agents: int) -> int:
        """One number orders each directed link, the last one rounds."""
        return agents * (agents - 1) + 1

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """The ages of the whole episode, [..., N, S] uint8."""
        amount = self.share * agents * (agents - 1)
        broken = int(amount) + (uniforms[..., -1] < amount - int(amount)).long()  # [...]
        rank = uniforms[..., :-1].argsort(-1).argsort(-1)  # [..., N*S], a random order
        return by_message(lost_where(rank < broken[..., None]), agents)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """The same again."""
        return Arriving(age=state, state=state)
