"""Broken links (at execution: paper l. 519-541): both directions of a link break together."""

from dataclasses import dataclass
from itertools import combinations
from typing import ClassVar

import torch
from torch import Tensor

from msgdrop_cli.channels import Arriving, Kind, Scene, lost_where


@dataclass(frozen=True, slots=True)
class Links(Kind):
    """Exactly this share of the links is broken, chosen at random once an episode (l. 525)."""

    example: ClassVar[tuple[float, ...]] = (0.5,)
    share: float
    """Of the links, i.e. unordered pairs of agents; from 0 to 1, as `Channel` sees to."""

    def episode_uniforms(self, agents: int) -> int:
        """One number orders each link, the last one rounds."""
        return agents * (agents - 1) // 2 + 1

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """Break the links of every game.

        uniforms: [..., L + 1] for L links; 7.5 of 15 links are 7 or 8 with probability 1/2 each
        (PAPER.md). Returns the ages of the whole episode, [..., N, S] uint8.
        Raises ValueError if the shape does not fit.
        """
        return broken_links(uniforms, self.share, agents)

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """The same again."""
        return Arriving(age=state, state=state)


def broken_links(uniforms: Tensor, share: float, agents: int) -> Tensor:
    """Ages [..., N, S] uint8 where this share of the links is broken; uniforms [..., L + 1]."""
    links = agents * (agents - 1) // 2
    if uniforms.shape[-1] != links + 1:
        raise ValueError(f"{links + 1} uniforms are needed for {agents} agents")
    whole = int(share * links)
    broken = whole + (uniforms[..., -1] < share * links - whole).long()  # [...]
    rank = uniforms[..., :-1].argsort(-1).argsort(-1)  # [..., L], a random order
    return lost_where(rank < broken[..., None])[..., link_of(agents).to(uniforms.device)]


def link_of(agents: int) -> Tensor:
    """The link between agent i and its sender k, [N, S]."""
    index = {pair: n for n, pair in enumerate(combinations(range(agents), 2))}
    return torch.tensor(
        [[index[min(i, j), max(i, j)] for j in range(agents) if j != i] for i in range(agents)]
    )
