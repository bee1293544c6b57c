"""Broken links at execution (paper l. 519-541): both directions of a link break together."""

from itertools import combinations

import torch
from torch import Tensor


def link_count(agents: int) -> int:
    """The number of links, i.e. unordered pairs of agents."""
    return agents * (agents - 1) // 2


def broken_links(uniforms: Tensor, fraction: float, agents: int) -> Tensor:
    """Break exactly `fraction` of the links, chosen at random, in every game.

    uniforms: [..., L + 1] with L = link_count(agents): one number orders each link, the last one
    rounds: 7.5 of 15 links are 7 or 8 with probability 1/2 each (paper-facts 6.3).
    Returns the keep mask [..., N, S] float32; sender k of agent i is agent k, or k + 1 from i on.
    Raises ValueError if `fraction` is not between 0 and 1 or the shape does not fit.
    """
    links = link_count(agents)
    if not 0.0 <= fraction <= 1.0:
        raise ValueError(f"fraction must be between 0 and 1, not {fraction}")
    if uniforms.shape[-1] != links + 1:
        raise ValueError(f"{links + 1} uniforms are needed for {agents} agents")
    whole = int(fraction * links)
    broken = whole + (uniforms[..., -1] < fraction * links - whole).long()  # [...]
    rank = uniforms[..., :-1].argsort(-1).argsort(-1)  # [..., L], a random order
    keep = (rank >= broken[..., None]).float()
    return keep[..., _link_of(agents).to(uniforms.device)]  # [..., N, S]


def _link_of(agents: int) -> Tensor:
    """The link between agent i and its sender k, [N, S]."""
    index = {pair: n for n, pair in enumerate(combinations(range(agents), 2))}
    return torch.tensor(
        [[index[min(i, j), max(i, j)] for j in range(agents) if j != i] for i in range(agents)]
    )
