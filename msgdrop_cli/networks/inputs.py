"""The masked input of a network: bytes times factors, as numbers or still apart.

Pursuit's observations are bytes of which about 8% are not zero. Where a C compiler was found,
they stay bytes and the first layer adds up the few rows of the weights that count (`sparse.c`);
otherwise, and on a GPU, they become a dense float tensor.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from msgdrop_cli.networks.kernel import Shape, kernel
from msgdrop_cli.ops.message_dropout import apply_keep


@dataclass(frozen=True, slots=True)
class SparseInput:
    """What `apply_keep(blocks, factor)` would be, not multiplied out."""

    blocks: Tensor
    """[G, B, J, O] uint8; the last two dimensions are contiguous."""
    factor: Tensor
    """[G, B, J, 1] or [G, B, J, O] float32; likewise."""

    def times(self, weight: Tensor, bias: Tensor) -> Tensor:
        """[G, B, J*O] times weight [G, J*O, H] plus bias [G, 1, H]: [G, B, H]."""
        library = kernel()
        assert library is not None
        networks, rows = self.blocks.shape[:2]
        out = torch.empty(networks, rows, weight.shape[-1])
        library.first_layer(
            self._shape(rows, weight.shape[-1]),
            self.blocks.data_ptr(),
            self.factor.data_ptr(),
            weight.data_ptr(),
            bias.data_ptr(),
            out.data_ptr(),
        )
        return out

    def gradient(self, grad_output: Tensor, out: Tensor) -> None:
        """Write dL/dweight [G, J*O, H] into `out`; grad_output [G, rows, H], of the first rows."""
        library = kernel()
        assert library is not None
        grad_output = grad_output.contiguous()
        library.first_layer_backward(
            self._shape(grad_output.shape[1], out.shape[-1]),
            self.blocks.data_ptr(),
            self.factor.data_ptr(),
            grad_output.data_ptr(),
            out.data_ptr(),
        )

    def _shape(self, rows: int, outputs: int) -> Shape:
        networks, _, blocks, units = self.blocks.shape
        x, f = self.blocks.stride(), self.factor.stride()
        factors = self.factor.shape[-1]
        return Shape(networks, rows, blocks, units, factors, outputs, x[0], x[1], f[0], f[1])


def masked_input(blocks: Tensor, factor: Tensor) -> Tensor | SparseInput:
    """The input of a network: blocks [G, B, 1+S, O] times factor [G, B, 1+S, 1 or O]."""
    if blocks.dtype == torch.uint8 and blocks.device.type == "cpu" and kernel() is not None:
        return SparseInput(blocks, factor)
    # A GPU casts while it multiplies; the CPU falls off its fast path (benchmarks/NOTES.md).
    return apply_keep(blocks if blocks.is_cuda else blocks.float(), factor).flatten(2)


def split_own(inputs: Tensor | SparseInput, observation: int) -> tuple[Tensor | SparseInput, ...]:
    """The own observation [G, B, O] and the messages [G, B, S*O] of inputs [G, B, (1+S)*O]."""
    if isinstance(inputs, SparseInput):
        blocks, factor = inputs.blocks, inputs.factor
        own = SparseInput(blocks[:, :, :1], factor[:, :, :1])
        return own, SparseInput(blocks[:, :, 1:], factor[:, :, 1:])
    return inputs[..., :observation], inputs[..., observation:]
