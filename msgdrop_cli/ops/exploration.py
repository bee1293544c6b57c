"""Epsilon-greedy actions (paper l. 201-203) and the schedule of epsilon (l. 753)."""

import torch
from torch import Tensor


def annealed_epsilon(env_steps: int, start: float, final: float, anneal_env_steps: int) -> float:
    """Epsilon after `env_steps`: linear from `start` to `final`, then fixed (paper l. 753)."""
    if anneal_env_steps <= 0:
        return final
    share = min(env_steps / anneal_env_steps, 1.0)
    return start + share * (final - start)


def epsilon_greedy(q: Tensor, uniforms: Tensor, epsilon: float) -> Tensor:
    """A uniformly random action with probability epsilon, otherwise the best one.

    q: [..., A]; uniforms: [..., 2] in [0, 1): whether to explore, and where. Returns [...] int64.
    """
    random = (uniforms[..., 1] * q.shape[-1]).long()
    return torch.where(uniforms[..., 0] < epsilon, random, q.argmax(-1))
