"""How a training process computes: what decides the last bits of a result beside its settings."""

import torch

THREADS = 1
"""Threads of a training process; another number changes the order of sums."""


def settle() -> None:
    """Let torch compute on one thread, and take numbers below 1.2e-38 for 0.

    Adam's first moment of an input that has gone silent fades by a tenth in every update until it
    is such a denormal number, where it stays; processors multiply those many times more slowly.
    """
    torch.set_num_threads(THREADS)
    torch.set_flush_denormal(True)
