"""Memory in large pages: a row drawn at random costs a walk through the page table otherwise."""

import ctypes
import mmap

import torch
from torch import Tensor


def zeros(*shape: int, dtype: torch.dtype, device: torch.device | str) -> Tensor:
    """Like torch.zeros; on Linux a CPU tensor asks for large pages before it is touched."""
    tensor = torch.empty(*shape, dtype=dtype, device=device)
    advice = getattr(mmap, "MADV_HUGEPAGE", None)
    if tensor.device.type == "cpu" and advice is not None:
        first = -(-tensor.data_ptr() // mmap.PAGESIZE) * mmap.PAGESIZE
        length = tensor.data_ptr() + tensor.nbytes - first
        if length > 0:  # advice only: where it is not taken, nothing changes
            madvise = ctypes.CDLL(None).madvise
            madvise(ctypes.c_void_p(first), ctypes.c_size_t(length), advice)
    return tensor.zero_()
