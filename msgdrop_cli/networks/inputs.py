"""The masked input of a network."""

from torch import Tensor

from msgdrop_cli.ops.message_dropout import apply_keep


def masked_input(blocks: Tensor, factor: Tensor) -> Tensor:
    """The input of a network: blocks [G, B, 1+S, O] times factor [G, B, 1+S, 1 or O]."""
    # A GPU casts while it multiplies; the CPU falls off its fast path (benchmarks/NOTES.md).
    return apply_keep(blocks if blocks.is_cuda else blocks.float(), factor).flatten(2)
