"""Message-dropout for other people's networks, to be used like `torch.nn.Dropout`.

The rule itself is that of `ops/message_dropout.py`; our own learners take it from there, since
their masks come from streams of their own.
"""

from collections.abc import Sequence
from numbers import Real
from typing import Literal, get_args, overload

import torch
from torch import Tensor, nn

from msgdrop_cli.ops.message_dropout import apply_keep, execution_scale, keep_mask

Kind = Literal["message", "element"]


class MessageDropout(nn.Module):
    """Drops the messages that agents get in training, and scales them in evaluation (l. 167-250).

    It differs from `torch.nn.Dropout` in three ways. Whole messages are dropped, not single numbers
    (with kind "element" single numbers are, the paper's standard dropout). The own
    observation is never dropped (with `keeps_own=False` it is, the paper's Full MD). And it is the
    paper's dropout, not torch's inverted one: in training what is kept stays as it is, and in
    evaluation nothing is dropped and messages are multiplied by 1 - rate. Networks trained with one
    of the two cannot be evaluated with the other.

    `train()` and `eval()` switch between the two as with every module. Each sample and sender has
    a draw of its own, from torch's generator, so `torch.manual_seed` repeats it.
    """

    def __init__(self, rate: float = 0.2, kind: Kind = "message", keeps_own: bool = True) -> None:
        """Take the probability of dropping and what is dropped as one.

        Raises ValueError for a rate outside 0 to 1 or an unknown kind.
        """
        super().__init__()
        _check(rate, kind)
        self.rate, self.kind, self.keeps_own = rate, kind, keeps_own

    @overload
    def forward(self, own: Tensor, *, keep: Tensor | None = None) -> Tensor: ...

    @overload
    def forward(
        self, own: Tensor, messages: Tensor, *, keep: Tensor | None = None
    ) -> tuple[Tensor, Tensor]: ...

    def forward(
        self, own: Tensor, messages: Tensor | None = None, *, keep: Tensor | None = None
    ) -> Tensor | tuple[Tensor, Tensor]:
        """Drop or scale; the shapes and types stay.

        own: blocks [..., 1+S, M], the own observation first, then S messages; returns them. Or own
        [..., O] alone with messages [..., S, M], where the two are apart; returns both.
        keep: a mask of `mask()` instead of a new one, in training; in evaluation it is not asked.
        Raises ValueError, which says what was expected, for other shapes and for whole numbers.
        """
        _check_shapes(own, messages, keep)
        if messages is None:
            return _times(own, self._factors(own.shape, own.device, keep))
        (*outer, senders, width), size = messages.shape, own.shape[-1]
        widest = width if self.keeps_own else max(width, size)
        factors = self._factors((*outer, 1 + senders, widest), messages.device, keep)
        heard = _times(messages, factors[..., 1:, :width])
        if self.keeps_own:
            return own, heard
        return _times(own[..., None, :], factors[..., :1, :size]).squeeze(-2), heard

    def mask(self, *shape: int, device: torch.device | str | None = None) -> Tensor:
        """Draw a keep mask for blocks of this shape (..., 1+S, M), 1 = it passes.

        For losses that need the same mask twice: DCC-MD's target sees m' through the mask of m
        (l. 241). Returns [..., 1+S, 1] float32, or [..., 1+S, M] for kind "element" (M: the wider
        of O and M where own observation and messages are apart). Raises ValueError for a shape that
        is none.
        """
        if len(shape) < 2 or min(shape) < 0 or shape[-2] < 1:
            raise ValueError(f"a mask needs the shape of blocks (..., 1+S, M), not {shape}")
        return _mask(shape, self.rate, self.kind, self.keeps_own, device)

    def extra_repr(self) -> str:
        """What `print` shows."""
        return f"rate={self.rate}, kind={self.kind!r}, keeps_own={self.keeps_own}"

    def _factors(self, shape: Sequence[int], device: torch.device, keep: Tensor | None) -> Tensor:
        if self.training:
            return self.mask(*shape, device=device) if keep is None else keep
        return _scale(shape, self.rate, self.keeps_own, device)


def message_dropout(
    blocks: Tensor,
    rate: float = 0.2,
    *,
    kind: Kind = "message",
    keeps_own: bool = True,
    training: bool = True,
) -> Tensor:
    """Do what `MessageDropout` does, as a function, like `torch.nn.functional.dropout`.

    blocks: [..., 1+S, M], the own observation first; returns the same shape and type. Raises
    ValueError for a rate outside 0 to 1, an unknown kind, other shapes or whole numbers.
    """
    _check(rate, kind)
    _check_shapes(blocks)
    if training:
        return _times(blocks, _mask(blocks.shape, rate, kind, keeps_own, blocks.device))
    return _times(blocks, _scale(blocks.shape, rate, keeps_own, blocks.device))


def _check(rate: float, kind: str) -> None:
    if isinstance(rate, bool) or not (isinstance(rate, Real) and 0.0 <= rate <= 1.0):
        raise ValueError(f"rate must be between 0 and 1, not {rate!r}")
    if kind not in get_args(Kind):
        raise ValueError(f"kind must be one of {', '.join(get_args(Kind))}, not {kind!r}")


def _check_shapes(own: Tensor, messages: Tensor | None = None, keep: Tensor | None = None) -> None:
    """ValueError for tensors that do not belong together."""
    blocks = own if messages is None else messages
    for name, part in (("own", own), ("messages", blocks)):
        if not part.is_floating_point():
            raise ValueError(f"{name} must be floating-point numbers, not {part.dtype}")
    if messages is None and (own.dim() < 2 or own.shape[-2] < 1):
        raise ValueError(f"blocks must be [..., 1+S, M], not {list(own.shape)}")
    if messages is not None and (messages.dim() < 2 or messages.shape[:-2] != own.shape[:-1]):
        given = f"{list(own.shape)} and {list(messages.shape)}"
        raise ValueError(f"expected own [..., O] and messages [..., S, M], not {given}")
    expected = (*blocks.shape[:-2], blocks.shape[-2] + (messages is not None))
    if keep is not None and (*keep.shape[:-1],) != expected:
        raise ValueError(f"keep must be {[*expected, '1 or M']}, not {list(keep.shape)}")


def _mask(
    shape: Sequence[int],
    rate: float,
    kind: Kind,
    keeps_own: bool,
    device: torch.device | str | None,
) -> Tensor:
    """New keep factors for blocks of this shape, [..., 1+S, 1 or M]."""
    *outer, blocks, width = shape
    dropped = (*outer, blocks - 1 if keeps_own else blocks, width if kind == "element" else 1)
    rates = torch.tensor([rate], device=device)
    keep = keep_mask(torch.rand(1, *dropped, device=device), rates)[0]
    if keeps_own:
        keep = torch.cat((keep.new_ones(*outer, 1, dropped[-1]), keep), -2)
    return keep


def _scale(
    shape: Sequence[int], rate: float, keeps_own: bool, device: torch.device | str | None
) -> Tensor:
    """The factors of execution, [1+S, 1]."""
    rates = torch.tensor([rate], device=device)
    return execution_scale(rates, shape[-2] - 1, drops_own=not keeps_own)[0]


def _times(blocks: Tensor, factors: Tensor) -> Tensor:
    """Blocks times factors, in the type of the blocks."""
    return apply_keep(blocks, factors.to(blocks.dtype))
