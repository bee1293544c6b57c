"""What this core can do at most: multiply-adds a second, and bytes a second, here and now."""

import time
from collections.abc import Callable

import numpy as np
import torch

SIDE = 512
"""Of the square matrices: 1 MB each, in the cache, and enough products to reach the peak."""
LARGE_BYTES = 256 * 2**20
"""More than any cache holds."""
ADAM_NUMBERS = 7
"""Weight, gradient and two moments read, all but the gradient written."""


def multiply_adds_per_s() -> float:
    """The faster of torch's and numpy's float32 matrix products: their libraries differ."""
    left, right = torch.rand(SIDE, SIDE), torch.rand(SIDE, SIDE)
    out = torch.empty(SIDE, SIDE)
    a, b, c = left.numpy(), right.numpy(), out.numpy()
    seconds = min(
        _fastest(lambda: torch.mm(left, right, out=out)),
        _fastest(lambda: np.matmul(a, b, out=c)),
    )
    return float(SIDE**3 / seconds)


def copied_bytes_per_s(moved_bytes: float) -> float:
    """A copy that reads one half of `moved_bytes` and writes the other."""
    source = torch.rand(int(moved_bytes / 8))
    target = torch.empty_like(source)
    return moved_bytes / _fastest(lambda: target.copy_(source))


def adam_bytes_per_s(parameters: int) -> float:
    """Adam on so many parameters, torch's fused one."""
    weight = torch.rand(parameters)
    weight.grad = torch.rand(parameters)
    adam = torch.optim.Adam([weight], fused=True)
    return ADAM_NUMBERS * 4 * parameters / _fastest(adam.step)


def _fastest(call: Callable[[], object], repeats: int = 8) -> float:
    """Seconds of this process that the fastest of some calls takes, the first one not counted."""
    call()
    best = float("inf")
    for _ in range(repeats):
        start = time.process_time()
        call()
        best = min(best, time.process_time() - start)
    return best
