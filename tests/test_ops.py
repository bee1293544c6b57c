"""The paper's equations with pencil-checkable numbers, and against torch's own."""

import math

import pytest
import torch
from torch import Tensor

from msgdrop_cli.ops.exploration import annealed_epsilon, epsilon_greedy
from msgdrop_cli.ops.message_dropout import apply_keep, execution_scale, keep_mask
from msgdrop_cli.ops.td import clip_factors, double_q_target, td_loss

ERRORS = torch.tensor([-3.0, -1.0, -0.25, 0.0, 0.5, 1.0, 7.0])


def _random(*shape: int, seed: int = 0) -> Tensor:
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed))


# message_dropout


def test_rate_is_the_probability_of_dropping() -> None:
    """A number below the rate drops, any other keeps: Bernoulli(rate) as keep would be reversed."""
    uniforms = torch.tensor([[0.0, 0.19, 0.2, 0.21, 0.999]])
    assert keep_mask(uniforms, torch.tensor([0.2])).tolist() == [[0.0, 0.0, 1.0, 1.0, 1.0]]


@pytest.mark.parametrize("rate", [0.1, 0.2, 0.5, 0.9])
def test_keep_mask_keeps_one_minus_rate(rate: float) -> None:
    """The share of kept units is 1 - rate within five standard deviations of a binomial."""
    count = 40_000
    kept = keep_mask(_random(1, count), torch.tensor([rate])).mean().item()
    assert abs(kept - (1 - rate)) < 5 * math.sqrt(rate * (1 - rate) / count)


def test_rates_0_and_1_are_exact() -> None:
    """Rate 0 keeps even the number 0; rate 1 drops even the largest number below 1."""
    extremes = torch.tensor([[0.0, 1.0 - 2.0**-24]])
    assert keep_mask(extremes, torch.zeros(1)).tolist() == [[1.0, 1.0]]
    assert keep_mask(extremes, torch.ones(1)).tolist() == [[0.0, 0.0]]


def test_every_run_has_its_own_rate() -> None:
    """The rate's first dimension is the run, whatever the shape behind it."""
    keep = keep_mask(torch.full((3, 2, 4), 0.3), torch.tensor([0.2, 0.3, 0.4]))
    assert keep.mean((1, 2)).tolist() == [1.0, 1.0, 0.0]


def test_apply_keep_replaces_whole_messages_by_zeros() -> None:
    """A mask [..., S, 1] takes away a whole message, also from bytes, and leaves the others."""
    blocks = torch.tensor([[1, 2], [3, 4], [5, 6]], dtype=torch.uint8)
    kept = apply_keep(blocks, torch.tensor([[1.0], [0.0], [0.5]]))
    assert kept.tolist() == [[1.0, 2.0], [0.0, 0.0], [2.5, 3.0]]
    assert kept.dtype == torch.float32


def test_apply_keep_takes_single_elements() -> None:
    """A mask [..., S, M] takes away single elements."""
    kept = apply_keep(torch.tensor([[1.0, 2.0], [3.0, 4.0]]), torch.tensor([[0.0, 1], [1, 0]]))
    assert kept.tolist() == [[0.0, 2.0], [3.0, 0.0]]


@pytest.mark.parametrize("shape", [(2, 1), (3, 2), (1, 1)])
def test_apply_keep_refuses_masks_that_do_not_fit(shape: tuple[int, int]) -> None:
    """A mask for other blocks is an error, not a broadcast."""
    with pytest.raises(ValueError, match="keep must be"):
        apply_keep(torch.ones(3, 4), torch.ones(shape))


def test_execution_scales_messages_by_one_minus_rate() -> None:
    """Own block 1, every message 1 - rate; the own block too if it was dropped in training."""
    rate = torch.tensor([0.0, 0.25, 1.0])
    scale = execution_scale(rate, 2, drops_own=False)
    assert scale[..., 0].tolist() == [[1, 1, 1], [1, 0.75, 0.75], [1, 0, 0]]
    assert execution_scale(rate, 2, drops_own=True)[1, :, 0].tolist() == [0.75, 0.75, 0.75]


# td


def test_double_q_target_by_pencil() -> None:
    """The selecting values pick the action, the target values give the number."""
    target = double_q_target(
        reward=torch.tensor([1.0, 2.0]),
        discount=torch.tensor([0.5, 0.0]),
        next_q_target=torch.tensor([[10.0, 20.0], [30.0, 40.0]]),
        next_q_select=torch.tensor([[3.0, 1.0], [0.0, 9.0]]),
    )
    assert target.tolist() == [1.0 + 0.5 * 10.0, 2.0]


def test_double_q_target_refuses_shapes_that_do_not_fit() -> None:
    """A reward of another batch size is an error, not a broadcast."""
    with pytest.raises(ValueError, match="shapes do not fit"):
        double_q_target(torch.ones(1), torch.ones(1), torch.ones(2, 5), torch.ones(2, 5))


def test_squared_error_by_pencil() -> None:
    """Squared, without a factor 1/2, sample by sample."""
    loss = td_loss(ERRORS, torch.zeros(7), "mse")
    assert loss.tolist() == [9.0, 1.0, 0.0625, 0.0, 0.25, 1.0, 49.0]


def test_huber_by_pencil() -> None:
    """Half the square up to an error of 1, then its size less a half."""
    loss = td_loss(ERRORS, torch.zeros(7), "huber")
    assert loss.tolist() == [2.5, 0.5, 0.03125, 0.0, 0.125, 0.5, 6.5]


def test_clipping_is_torchs_for_each_row() -> None:
    """Each network is clipped by its own norm, as torch clips one module; small ones are left."""
    gradients = _random(4, 50) * torch.tensor([[0.01], [1.0], [10.0], [0.0]])
    clipped = gradients * clip_factors(gradients, 2.0)[:, None]
    for row, ours in zip(gradients, clipped, strict=True):
        parameter = torch.nn.Parameter(torch.zeros(50))
        parameter.grad = row.clone()
        torch.nn.utils.clip_grad_norm_([parameter], 2.0)
        torch.testing.assert_close(ours, parameter.grad, rtol=1e-5, atol=0.0)
    assert torch.equal(clipped[0], gradients[0])


# exploration


def test_epsilon_is_annealed_linearly_and_then_stays() -> None:
    """From 1 to 0.02 in a line over the first 2 million env steps, then 0.02 (paper l. 753)."""
    steps = [0, 500_000, 1_000_000, 2_000_000, 9_000_000]
    found = [annealed_epsilon(s, 1.0, 0.02, 2_000_000) for s in steps]
    assert found == pytest.approx([1.0, 0.755, 0.51, 0.02, 0.02])
    assert annealed_epsilon(0, 1.0, 0.02, 0) == 0.02


@pytest.mark.parametrize("over", [0, 3, 2_000_000])
def test_epsilon_of_a_tensor_has_the_bits_of_a_number(over: int) -> None:
    """A step that is repeated on a GPU counts in tensors, and explores no other action."""
    steps = [*range(1, 40), 123_457, 1_999_999, 2_000_001]
    found = [annealed_epsilon(torch.tensor(float(s)).double(), 1.0, 0.02, over) for s in steps]
    assert [float(f) for f in found] == [annealed_epsilon(s, 1.0, 0.02, over) for s in steps]


def test_a_number_at_epsilon_explores_neither_way() -> None:
    """Numbers just below, at and above epsilon are judged alike against a number and a tensor."""
    q = torch.tensor([[0.0, 1.0]] * 3)
    epsilon = annealed_epsilon(7_777, 1.0, 0.02, 100_000)
    at = torch.tensor(epsilon)
    first = torch.stack((at.nextafter(torch.tensor(0.0)), at, at.nextafter(torch.tensor(1.0))))
    uniforms = torch.stack((first, torch.zeros(3)), -1)
    actions = epsilon_greedy(q, uniforms, epsilon)
    assert torch.equal(actions, epsilon_greedy(q, uniforms, torch.tensor(epsilon).double()))


def test_epsilon_greedy_by_pencil() -> None:
    """The first number decides whether to explore (below epsilon), the second one where."""
    q = torch.tensor([[0.0, 3.0, 1.0]] * 4)
    uniforms = torch.tensor([[0.29, 0.0], [0.29, 0.67], [0.3, 0.0], [0.29, 1.0 - 2.0**-24]])
    assert epsilon_greedy(q, uniforms, 0.3).tolist() == [0, 2, 1, 2]


def test_epsilon_0_never_explores_and_1_always_does() -> None:
    """Epsilon 0 is greedy; epsilon 1 draws all five actions equally often (5 sigma)."""
    q, count = torch.tensor([0.0, 0.0, 1.0, 0.0, 0.0]).expand(50_000, 5), 50_000
    uniforms = _random(count, 2)
    assert (epsilon_greedy(q, uniforms, 0.0) == 2).all()
    share = epsilon_greedy(q, uniforms, 1.0).bincount(minlength=5) / count
    assert (share - 0.2).abs().max() < 5 * math.sqrt(0.2 * 0.8 / count)
