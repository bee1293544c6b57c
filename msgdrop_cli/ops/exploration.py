"""Exploration: epsilon-greedy (paper l. 201-203, 753) and Gaussian noise on actions (l. 772)."""

import math

import torch
from torch import Tensor


def annealed_epsilon(
    env_steps: float | Tensor, start: float, final: float, anneal_env_steps: int
) -> float | Tensor:
    """Epsilon after `env_steps`: linear from `start` to `final`, then fixed (paper l. 753).

    env_steps: a number, or a float64 tensor [] that gives the same bits as one.
    """
    if anneal_env_steps <= 0:
        return 0.0 * env_steps + final
    share = env_steps / anneal_env_steps
    share = share.clamp(max=1.0) if isinstance(share, Tensor) else min(share, 1.0)
    return start + share * (final - start)


def epsilon_greedy(q: Tensor, uniforms: Tensor, epsilon: float | Tensor) -> Tensor:
    """A uniformly random action with probability epsilon, otherwise the best one.

    q: [..., A]; uniforms: [..., 2] in [0, 1): whether to explore, and where; epsilon: a number or
    a tensor []. Returns [...] int64.
    """
    return explored(q.argmax(-1), q.shape[-1], uniforms, epsilon)


def explored(actions: Tensor, choices: int, uniforms: Tensor, epsilon: float | Tensor) -> Tensor:
    """A uniformly random one of the choices with probability epsilon, otherwise the action.

    actions: [...] int64; uniforms: [..., 2] as above. Returns [...] int64.
    """
    random = (uniforms[..., 1] * choices).long()
    return torch.where(uniforms[..., 0] < epsilon, random, actions)


def normals(uniforms: Tensor) -> Tensor:
    """Standard normal numbers, each from two uniforms in [0, 1) by Box and Muller's rule.

    uniforms: [..., 2*A], the radii's numbers and then the angles'. Returns [..., A] float32.
    """
    radius, angle = uniforms.chunk(2, -1)
    return (-2.0 * (1.0 - radius).log()).sqrt() * (2.0 * math.pi * angle).cos()


def noisy_action(action: Tensor, uniforms: Tensor, sigma: float) -> Tensor:
    """The action with Gaussian noise (paper l. 772), kept in [-1, 1].

    action: [..., A]; uniforms: [..., 2*A] in [0, 1). Returns [..., A].
    """
    return (action + sigma * normals(uniforms)).clamp(-1.0, 1.0)


def random_action(uniforms: Tensor) -> Tensor:
    """An action uniform in [-1, 1), from the first half of uniforms [..., 2*A]: [..., A]."""
    return 2.0 * uniforms.chunk(2, -1)[0] - 1.0
