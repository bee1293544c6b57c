"""The masked input of a network."""

from torch import Tensor

from msgdrop_cli.ops.message_dropout import apply_keep


def masked_input(blocks: Tensor, factor: Tensor) -> Tensor:
    """The input of a network: blocks [G, B, 1+S, O] times factor [G, B, 1+S, 1 or O]."""
    return apply_keep(blocks.float(), factor).flatten(2)
