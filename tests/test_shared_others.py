"""The products that all agents share against every agent's own masked copy of the others."""

import pytest
import torch
from torch import Tensor

from msgdrop_cli.networks.shared_others import Blocks, SharedOthers
from tests.dcc_samples import rand

RUNS, BATCH, AGENTS, UNITS, OUTPUTS = 2, 5, 4, 7, 6
SENDERS = AGENTS - 1


def copied(joint: Tensor, keep: Tensor) -> Tensor:
    """What each agent is shown, block by block: [R, B*N, S*U]."""
    shown = [[j for j in range(AGENTS) if j != i] for i in range(AGENTS)]
    seen = [joint[:, :, shown[i]] * keep[:, :, i, :, None] for i in range(AGENTS)]
    return torch.stack(seen, 2).flatten(3).flatten(1, 2)


@pytest.mark.parametrize("masked", [False, True])
def test_sums_of_shared_products_are_the_layer(masked: bool) -> None:
    """Outputs and the weights' gradient, of observations and actions, masks of their own."""
    obs, acts = rand(RUNS, BATCH, AGENTS, UNITS, seed=1), rand(RUNS, BATCH, AGENTS, 2, seed=2)
    keep = (rand(RUNS, BATCH, AGENTS, SENDERS, seed=3) < 0.6).float()
    action_keep = keep if masked else torch.ones_like(keep)
    weight = rand(RUNS, SENDERS * (UNITS + 2), OUTPUTS, seed=4) - 0.5
    bias, grad = rand(RUNS, 1, OUTPUTS, seed=5), rand(RUNS, BATCH * AGENTS, OUTPUTS, seed=6)
    inputs = torch.cat((copied(obs, keep), copied(acts, action_keep)), -1)
    others = SharedOthers(Blocks.of(obs, keep), Blocks.of(acts, action_keep))
    torch.testing.assert_close(others.times(weight, bias), inputs @ weight + bias)
    found = torch.full_like(weight, torch.nan)
    others.gradient(grad, found)
    torch.testing.assert_close(found, inputs.mT @ grad)


def test_only_two_agents_stand_in_a_slot() -> None:
    """That is what makes it a quarter: 14 products of a sample for 8 agents, not 56."""
    obs = rand(1, BATCH, 8, UNITS, seed=1)
    blocks = Blocks.of(obs, torch.ones(1, BATCH, 8, 7))
    slots = blocks.slots if isinstance(blocks.slots, torch.Tensor) else blocks.slots.rows
    assert slots.shape == (7, 2 * BATCH, UNITS)
    assert torch.equal(blocks.choice.sum(-1), torch.full((BATCH, 8), 7.0))
