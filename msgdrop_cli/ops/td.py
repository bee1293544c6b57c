"""The targets and losses of Q-learning."""

from typing import Literal

import torch
from torch import Tensor


def double_q_target(
    reward: Tensor, discount: Tensor, next_q_target: Tensor, next_q_select: Tensor
) -> Tensor:
    """The target y of DCC-MD's loss (paper, label eq:5, l. 247).

    reward, discount: [..., B]; next_q_target, next_q_select: [..., B, A], float32; discount is
    gamma, or 0 at a true end. `next_q_select` is Q_exec of the online network on *unmasked*
    messages; it only picks the action. Returns [..., B]. Raises ValueError for other shapes.
    """
    if next_q_target.shape != next_q_select.shape or reward.shape != next_q_target.shape[:-1]:
        raise ValueError(
            f"shapes do not fit: reward {tuple(reward.shape)}, next_q_target"
            f" {tuple(next_q_target.shape)}, next_q_select {tuple(next_q_select.shape)}"
        )
    best = next_q_select.argmax(-1, keepdim=True)
    return reward + discount * next_q_target.gather(-1, best).squeeze(-1)


def loss_gradient(error: Tensor, loss: Literal["mse", "huber"]) -> tuple[Tensor, Tensor]:
    """The loss of each sample and its derivative by the error.

    error: [...]. `mse` is the paper's squared error (l. 244); `huber` (delta 1) is the one of
    OpenAI baselines. Returns two tensors [...].
    """
    if loss == "mse":
        return error.square(), 2.0 * error
    clipped = error.clamp(-1.0, 1.0)
    return clipped * (error - 0.5 * clipped), clipped


def clip_factors(gradients: Tensor, limit: float) -> Tensor:
    """Factors that bring each row to at most `limit` in L2 norm. gradients: [G, P]; returns [G]."""
    norm = torch.linalg.vector_norm(gradients, dim=-1)
    factors: Tensor = (limit / norm.clamp(min=1e-12)).clamp(max=1.0)
    return factors
