"""Message-dropout itself (paper l. 167-250): who is dropped, and what is left of the messages.

Masks are *keep* masks, 1 = it passes. `rate` is the probability of *dropping*; the paper's
"b ~ Bernoulli(p)" (l. 241) can only be meant as b = 0 with probability p (l. 173, l. 262-263).
Letters: `R` runs, `N` agents, `G = R*N`, `S` senders, `B` batch, `M` one message.
"""

from collections.abc import Sequence
from typing import NamedTuple

from torch import Tensor, cat

from msgdrop_cli.ops.minibatch import Minibatch


class InputFactors(NamedTuple):
    """What the inputs of one update are multiplied by, [G, B or 1, 1+S, 1 or more] each."""

    now: Tensor
    """(o, m): the mask b (paper l. 217)."""
    after: Tensor
    """(o', m') in the target network: the same mask."""
    executed: Tensor
    """(o', m') in Q_exec: 1 - rate (l. 248)."""

    def arriving(self, drawn: Minibatch, links: Tensor) -> "InputFactors":
        """0 for messages that a channel lost in training, in this step or in the next one.

        links: [N, S], where those who are heard stand among all others.
        """
        if drawn.arrives is None:
            return self
        now, after = drawn.arrived(links)  # [G, B, S]
        found = []
        for factor, arrives in zip(self, (now, after, after), strict=True):
            found.append(factor.expand(-1, arrives.shape[1], -1, -1).clone())
            found[-1][:, :, 1:] *= arrives[..., None]
        return InputFactors(*found)


def keep_mask(uniforms: Tensor, rate: Tensor) -> Tensor:
    """1 where a unit is kept, with probability 1 - rate (paper l. 173, 235-241).

    uniforms: [R, ...] in [0, 1); rate: [R], the probability of dropping.
    Returns [R, ...] float32 of 0 and 1. Rate 0 keeps all, rate 1 keeps none.
    """
    return (uniforms >= rate.view(-1, *[1] * (uniforms.dim() - 1))).float()


def apply_keep(blocks: Tensor, keep: Tensor) -> Tensor:
    """Replace what is not kept by zeros (the paper's arrow-0, l. 179), in training or execution.

    blocks: [..., S, M], any dtype; keep: [..., S, 1] for whole messages (message-dropout, broken
    links), [..., S, M] for single elements; factors other than 0 and 1 scale.
    Returns float32. Raises ValueError for other shapes.
    """
    if keep.shape[-1] not in (1, blocks.shape[-1]) or keep.shape[-2] != blocks.shape[-2]:
        raise ValueError(
            f"keep must be [..., S, 1] or [..., S, M] for blocks {tuple(blocks.shape)},"
            f" not {tuple(keep.shape)}"
        )
    return blocks * keep


def inputs_of(blocks: Sequence[Tensor], factor: Tensor) -> Tensor:
    """The inputs of networks [G, B, inputs]: blocks times their factors, side by side.

    blocks: [G, B, blocks, U], in one or several tensors, which differ in U; factor [G, B, all
    blocks, 1 or at least U], of which narrower blocks take the first.
    """
    parts, first = [], 0
    for part in blocks:
        last = first + part.shape[2]
        parts.append(apply_keep(part, factor[:, :, first:last, : part.shape[3]]).flatten(2))
        first = last
    return cat(parts, 2) if len(parts) > 1 else parts[0]


def execution_scale(rate: Tensor, senders: int, *, drops_own: bool) -> Tensor:
    """The factors of Q_exec: own block 1, every message 1 - rate (paper l. 173, 248).

    The paper multiplies the *outgoing weights* of the dropped units by 1 - p. For a linear layer
    that is the same as multiplying the inputs, the bias untouched (test_scaling_inputs_is_
    scaling_weights). With `drops_own` (Full MD, Full SD) the own block was dropped too and is
    scaled as well. rate: [R]; returns [R, 1 + S, 1] float32, the own block first.
    """
    scale = (1.0 - rate)[:, None, None].repeat(1, 1 + senders, 1)
    if not drops_own:
        scale[:, 0] = 1.0
    return scale
