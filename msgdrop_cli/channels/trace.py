"""A recorded link trace, played back: who heard whom, step by step, as it was measured."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import torch
from torch import Tensor

from msgdrop_cli.channels import LOST, Arriving, Kind, Scene
from msgdrop_cli.definition.traces import TraceFile


@dataclass(frozen=True, slots=True)
class Trace(Kind):
    """Each episode begins anywhere in the trace; after the last step comes the first."""

    example: ClassVar[tuple[float, ...]] = ()
    file: TraceFile
    """A CSV file with the columns step, receiver, sender and age, as docs/channels.md says."""

    def __post_init__(self) -> None:
        assert len(self.ages)  # read now: a file that is no trace is refused at once

    @cached_property
    def ages(self) -> Tensor:
        """[steps, N, S] uint8."""
        found = self.file.trace()
        ages = torch.frombuffer(found.ages, dtype=torch.uint8)
        return ages.view(found.steps, found.agents, found.agents - 1)

    def check(self, agents: int) -> None:
        """It is of as many agents as the game has."""
        if agents != self.ages.shape[1]:
            raise ValueError(f"{self.file.path} is of {self.ages.shape[1]} agents, not of {agents}")

    @property
    def oldest(self) -> int:
        """The greatest age in it."""
        return int(self.ages.where(self.ages != LOST, 0).max())

    def episode_uniforms(self, agents: int) -> int:
        """One: where the episode begins."""
        return 1

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """The step of the trace that comes next, [...] int64."""
        return (uniforms[..., 0].double() * len(self.ages)).long()

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """What the trace says."""
        return Arriving(self.ages.to(state.device)[state], (state + 1) % len(self.ages))
