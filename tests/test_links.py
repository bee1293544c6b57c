"""The paper's channel: how many links break, which ones, and that both directions do."""

import math

import pytest
import torch
from torch import Tensor

from msgdrop_cli.channels.links import Links
from msgdrop_cli.definition.channel import Channel


def _random(*shape: int, seed: int = 0) -> Tensor:
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed))


def _matrix(keep: Tensor, agents: int) -> Tensor:
    """The masks [..., N, S] as [..., N, N], the agents' own places 1."""
    matrix = torch.ones(*keep.shape[:-2], agents, agents)
    for i in range(agents):
        matrix[..., i, [j for j in range(agents) if j != i]] = keep[..., i, :]
    return matrix


def _keep(share: float, uniforms: Tensor, agents: int) -> Tensor:
    """1 where a message arrives, [..., N, S]."""
    return (Links(share).start(uniforms, agents) == 0).float()


@pytest.mark.parametrize(("agents", "fraction"), [(6, 0.5), (8, 0.5), (6, 0.2), (3, 0.9)])
def test_links_break_in_both_directions(agents: int, fraction: float) -> None:
    """If j's messages do not reach i, i's do not reach j."""
    keep = _keep(fraction, _random(50, Links(fraction).episode_uniforms(agents)), agents)
    matrix = _matrix(keep, agents)
    assert torch.equal(matrix, matrix.mT)
    assert 0.0 < keep.mean() < 1.0


def test_exactly_half_of_28_links_break() -> None:
    """With 8 agents 14 of 28 links break in every game, i.e. 28 of the 56 messages."""
    keep = _keep(0.5, _random(2_000, 29), 8)
    assert (keep.sum((-2, -1)) == 28.0).all()
    per_link = keep.mean(0)
    assert (per_link - 0.5).abs().max() < 5 * math.sqrt(0.25 / 2_000)  # none is favoured


def test_half_of_15_links_is_7_or_8_equally_often() -> None:
    """With 6 agents 7 or 8 of 15 links break, each in half of the games (5 sigma)."""
    count = 4_000
    broken = 15 - _keep(0.5, _random(count, 16), 6).sum((-2, -1)) / 2
    assert set(broken.tolist()) == {7.0, 8.0}
    assert abs((broken == 8.0).float().mean().item() - 0.5) < 5 * math.sqrt(0.25 / count)


@pytest.mark.parametrize("agents", [2, 6, 8])
def test_no_links_and_all_links_break_exactly(agents: int) -> None:
    """Fraction 0 keeps every message, fraction 1 none, whatever the numbers are."""
    uniforms = _random(100, Links(0.0).episode_uniforms(agents))
    uniforms[0] = 0.0
    assert _keep(0.0, uniforms, agents).all()
    assert not _keep(1.0, uniforms, agents).any()


def test_broken_links_refuses_impossible_input() -> None:
    """Numbers for another team are an error, and so is a share outside 0 to 1."""
    with pytest.raises(ValueError, match="one share from 0 to 1"):
        Channel("links", (1.1,))
    with pytest.raises(ValueError, match="16 uniforms"):
        Links(0.5).start(torch.zeros(15), 6)
