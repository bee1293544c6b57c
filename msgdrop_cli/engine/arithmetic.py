"""How training and evaluation compute: what decides a result's last bits beside its settings."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

THREADS = 1
"""Threads of torch; another number changes the order of sums."""
_DENORMAL = 1e-39


@contextmanager
def settled() -> Iterator[None]:
    """Let torch compute on one thread, without autograd, and take numbers below 1.2e-38 for 0.

    Adam's first moment of an input that has gone silent fades by a tenth in every update until it
    is such a denormal number, where it stays; processors multiply those many times more slowly.
    The last is undone afterwards, since numpy and matplotlib share the processor's switch.
    """
    torch.set_num_threads(THREADS)
    before = bool(torch.tensor(_DENORMAL) * 1.0 == 0)
    torch.set_flush_denormal(True)
    try:
        with torch.inference_mode():
            yield
    finally:
        torch.set_flush_denormal(before)
