"""Messages that take a random time; where one overtakes another, the newest counts."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from msgdrop_cli.channels import LOST, Arriving, Kind, Scene, by_message, check_whole
from msgdrop_cli.definition.traces import OLDEST


@dataclass(frozen=True, slots=True)
class Jitter(Kind):
    """Each message takes a whole number of steps between two bounds, each with equal chance."""

    example: ClassVar[tuple[float, ...]] = (0.0, 3.0)
    least: float
    most: float

    def __post_init__(self) -> None:
        check_whole("the longest delay in steps", self.most, 0, OLDEST)
        check_whole("the shortest delay in steps", self.least, 0, int(self.most))

    @property
    def oldest(self) -> int:
        """What was said `most` steps ago is there in any case."""
        return int(self.most)

    def step_uniforms(self, agents: int) -> int:
        """One for each message."""
        return agents * (agents - 1)

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """When the messages of the last steps are due, [..., N, S, most + 1] uint8: not yet any."""
        shape = (*uniforms.shape[:-1], agents, agents - 1, self.oldest + 1)
        return torch.full(shape, LOST, dtype=torch.uint8, device=uniforms.device)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """State [..., j]: how many steps the message of j steps ago takes."""
        choices = self.most - self.least + 1
        takes = (by_message(uniforms, scene.agents) * choices).long() + int(self.least)
        state = torch.cat((takes.to(torch.uint8)[..., None], state[..., :-1]), -1)
        ages = torch.arange(self.oldest + 1, dtype=torch.uint8, device=state.device)
        there = torch.where(state <= ages, ages, LOST)  # of the messages of each age
        return Arriving(there.amin(-1), state)
