"""The targets and losses of Q-learning."""

from typing import Literal

import torch
from torch import Tensor
from torch.nn.functional import huber_loss, mse_loss


def double_q_target(
    reward: Tensor, discount: Tensor, next_q_target: Tensor, next_q_select: Tensor
) -> Tensor:
    """The target y of DCC-MD's loss (paper, l. 247).

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


def td_loss(q: Tensor, target: Tensor, loss: Literal["mse", "huber"]) -> Tensor:
    """The loss of each sample: `mse` is the paper's squared error (l. 244).

    q, target: [...]. `huber` (delta 1) is the one of OpenAI baselines. Returns [...].
    """
    function = mse_loss if loss == "mse" else huber_loss
    return function(q, target, reduction="none")


def clip_factors(gradients: Tensor, limit: float) -> Tensor:
    """Factors that bring each row to at most `limit` in L2 norm. gradients: [G, P]; returns [G]."""
    norm = torch.linalg.vector_norm(gradients, dim=-1)
    factors: Tensor = (limit / norm.clamp(min=1e-12)).clamp(max=1.0)
    return factors
