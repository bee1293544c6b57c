"""Rows that are mostly 0, such as waterworld's sensors, as the input of a first layer.

On the CPU, where a C compiler was found, zeros are skipped (`sparse_rows.c`); elsewhere the rows
stay what they are, a tensor.
"""

import ctypes
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch
from torch import Tensor

from msgdrop_cli.networks.kernel import load

NAME = "c-sparse-rows"
_SOURCE = Path(__file__).with_suffix(".c")


class _Shape(ctypes.Structure):
    _fields_ = tuple((n, ctypes.c_int64) for n in ("networks", "rows", "units", "outputs"))


@dataclass(frozen=True, slots=True)
class SparseRows:
    """Rows [G, B, in], of which what is 0 costs next to nothing."""

    rows: Tensor
    """[G, B, in] float32, contiguous."""

    def times(self, weight: Tensor, bias: Tensor | None) -> Tensor:
        """[G, B, in] times weight [G, in, H] plus bias [G, 1, H] or nothing: [G, B, H]."""
        out = torch.empty(*self.rows.shape[:2], weight.shape[-1])
        self._run("sparse_rows", weight.contiguous(), bias, out)
        return out

    def gradient(self, grad_output: Tensor, out: Tensor) -> None:
        """Write dL/dweight [G, in, H] into `out`, contiguous; grad_output [G, B, H]."""
        self._run("sparse_rows_backward", grad_output.contiguous(), out)

    def _run(self, function: str, *tensors: Tensor | None) -> None:
        library = _library()
        assert library is not None
        shape = _Shape(*self.rows.shape, tensors[-1].shape[-1])  # type: ignore[union-attr]
        pointers = (None if each is None else each.data_ptr() for each in (self.rows, *tensors))
        getattr(library, function)(ctypes.byref(shape), *map(ctypes.c_void_p, pointers))


def sparse_rows(rows: Tensor) -> Tensor | SparseRows:
    """The rows [G, B, in], to be multiplied without their zeros if this machine can."""
    return SparseRows(rows.contiguous()) if skips_zeros(rows.device) else rows


def skips_zeros(device: torch.device | str) -> bool:
    """Whether zeros are skipped on this device; the bits of a result depend on it."""
    return torch.device(device).type == "cpu" and _library() is not None


def matmul(rows: Tensor | SparseRows, weight: Tensor) -> Tensor:
    """Rows [G, B, in] times weight [G, in, H]: [G, B, H]."""
    if isinstance(rows, SparseRows):
        return rows.times(weight, None)
    return torch.bmm(rows, weight)


def matmul_gradient(rows: Tensor | SparseRows, grad_output: Tensor) -> Tensor:
    """dL/dweight [G, in, H] of `matmul`; grad_output [G, B, H]."""
    if isinstance(rows, SparseRows):
        out = torch.empty(len(rows.rows), rows.rows.shape[-1], grad_output.shape[-1])
        rows.gradient(grad_output, out)
        return out
    return torch.bmm(rows.mT, grad_output)


@cache
def _library() -> ctypes.CDLL | None:
    return load(_SOURCE)
