"""The links that a policy would miss most, found by breaking them on episodes of their own.

Greedily, as whoever attacks would: first the one link whose loss costs most, then, with that one
broken, the next. The games are those of a stream of their own, the same for every link, and not the
ones that evaluation plays.
"""

from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor

from msgdrop_cli.channels.links import link_of
from msgdrop_cli.engine import arithmetic
from msgdrop_cli.engine.playing import play_episodes
from msgdrop_cli.engine.policy import read_trained
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.messages.received import Received
from msgdrop_envs.autoreset import Games
from msgdrop_envs.protocol import Environment

EPISODES = 64
"""Of each link that is tried, where nobody says how many."""
_AT_ONCE = 16_384
"""Episodes that are played side by side; those of one link always are."""
Policy = Callable[[Tensor, Received], Tensor]
"""Actions [1, P, N, ...] of observations [1, P, N, O] and what arrives."""


class Link(NamedTuple):
    """What a policy gets in an episode if this link is broken, too."""

    agents: tuple[int, int]
    returns: float
    """The mean return of an episode."""


class Tiled(Streams):
    """Streams that hand the same numbers to several groups of episodes."""

    def __init__(self, seed: int, groups: int, device: torch.device | str) -> None:
        super().__init__([seed], device)
        self._groups = groups

    def uniforms(self, name: str, *shape: int) -> Tensor:
        """[1, episodes, ...] of the stream `worst`, whatever is asked for: the same for all."""
        numbers = super().uniforms("worst", shape[0] // self._groups, *shape[1:])
        return numbers.repeat(1, self._groups, *[1] * (numbers.dim() - 2))


def without_each(
    act: Policy,
    env: Environment,
    seed: int,
    broken: Tensor,
    device: torch.device | str,
    episodes: int = EPISODES,
) -> list[Link]:
    """What each of the other links is worth while those of `broken` [L] bool are broken.

    Returns one for each of them, in order, whoever costs most first.
    """
    agents = list(combinations(range(env.agents), 2))
    tried = [n for n in range(len(agents)) if not broken[n]]
    lost = broken.repeat(len(tried), 1)
    lost[torch.arange(len(tried)), torch.tensor(tried, dtype=torch.long)] = True
    returns = play_without(act, env, seed, lost, device, episodes).tolist()
    found = [Link(agents[n], value) for n, value in zip(tried, returns, strict=True)]
    return sorted(found, key=lambda link: (link.returns, link.agents))


def play_without(
    act: Policy,
    env: Environment,
    seed: int,
    lost: Tensor,
    device: torch.device | str,
    episodes: int = EPISODES,
) -> Tensor:
    """The mean return of an episode for each set of broken links; lost [sets, L] bool."""
    together = max(1, _AT_ONCE // episodes)
    parts = [
        _play_together(act, env, seed, sets, device, episodes) for sets in lost.split(together)
    ]
    return torch.cat(parts)


def _play_together(
    act: Policy,
    env: Environment,
    seed: int,
    lost: Tensor,
    device: torch.device | str,
    episodes: int,
) -> Tensor:
    keep = (~lost).float()[:, link_of(env.agents)].to(device)  # [sets, N, S]
    keep = keep.repeat_interleave(episodes, 0)[None]

    def broken(games: Games, playing: Tensor) -> Tensor:
        return act(games.obs, Received(keep[:, playing]))

    table = play_episodes(env, broken, Tiled(seed, len(lost), device), len(keep[0]))
    assert table is not None
    return table[:, 2].view(len(lost), episodes).mean(1)


def worst_links(
    act: Policy, env: Environment, seed: int, count: int, device: torch.device | str = "cpu"
) -> Tensor:
    """The messages of the `count` links whose loss costs most, [N, S] bool."""
    agents = list(combinations(range(env.agents), 2))
    broken = torch.zeros(len(agents), dtype=torch.bool)
    for _ in range(min(count, len(agents))):
        worst = without_each(act, env, seed, broken, device)[0]
        broken[agents.index(worst.agents)] = True
    return broken[link_of(env.agents)].to(device)


def links_of_run(
    run_path: Path, episodes: int = EPISODES, device: str = "cpu"
) -> tuple[float, list[Link]]:
    """The mean return with all links, and what is left of it without each one, worst first.

    Raises RecordError if the policy cannot be read or does not fit.
    """
    with arithmetic.settled():
        spec, env, learner = read_trained(run_path, device)
        act, seed = learner.act_greedily, spec.seed
        none = torch.zeros(env.agents * (env.agents - 1) // 2, dtype=torch.bool)
        [whole] = play_without(act, env, seed, none[None], device, episodes).tolist()
        return whole, without_each(act, env, seed, none, device, episodes)
