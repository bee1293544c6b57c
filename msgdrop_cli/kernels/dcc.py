"""What calls dcc.c: Q-values and updates of the networks h(f, g) and of plain perceptrons."""

from collections.abc import Mapping
from ctypes import Structure, byref, c_int64, c_void_p

import torch
from torch import Tensor
from torch.nn.functional import pad

from msgdrop_cli.kernels.build import library
from msgdrop_cli.kernels.structs import (
    LANES,
    DCCMemory,
    DCCNet,
    DCCRule,
    Factors,
    Layer,
    adam,
    layers,
    outcome,
    parameters,
    pointer,
)
from msgdrop_cli.networks.stacked import Layers, Stacked
from msgdrop_cli.ops.message_dropout import InputFactors
from msgdrop_cli.ops.minibatch import Minibatch

NAME = "c-dcc-fma"
_CHUNK = 64
"""Rows at a time when nothing is learnt: an agent's weights are read once for so many."""


def serves(
    layers: Layers,
    observation: int,
    dtype: torch.dtype,
    apart: bool,
    *,
    clips: bool,
    device: torch.device | str,
) -> bool:
    """Whether dcc.c was written for such networks, inputs and settings, and is there.

    apart: whether messages are other numbers than observations.

    Every width must be a multiple of LANES, and there must be no more actions. A clipped gradient
    has to be known as a whole before the step, which is not how the file works. Bytes are listed
    and numbers are multiplied, so no layer may see bytes and messages that are numbers.
    """
    *hidden, actions = (outputs for _, outputs in layers.values())
    known = (
        torch.device(device).type == "cpu"
        and dtype in (torch.uint8, torch.float32)
        and all(width % LANES == 0 for width in hidden)
        and actions <= LANES
        and not (apart and dtype == torch.uint8 and "g1" not in layers)
        and observation < 2**16  # nonzeros.h numbers a block's inputs in two bytes
        and not clips
    )
    return known and library() is not None


class DCCKernel:
    """Q-values and updates of G = R*N networks whose weights and moments stay where they are."""

    def __init__(
        self,
        parts: Mapping[str, Stacked],
        shown: Tensor,
        *,
        observation: int,
        message: int | None,
        dtype: torch.dtype,
        batch_size: int,
        learning_rate: float,
        gamma: float,
        huber: bool,
    ) -> None:
        """parts: online, target, exp_avg, exp_avg_sq; shown [N, 1+S]: whom agent i is shown.

        message: the numbers of one that is stored beside the observations, None if these are the
        messages.
        """
        functions = library()
        assert functions is not None
        functions.dcc_scratch_bytes.restype = c_int64
        self._functions, self._shown, self._dtype = functions, shown, dtype
        self._learning_rate, self._gamma, self._huber = learning_rate, gamma, huber
        self._parameters = parameters(parts)
        online = parts["online"]
        found = list(layers(online).values())  # f1, f2, g1, h1, h2; a perceptron has no g
        found = found if len(found) == 5 else [*found[:2], Layer(), *found[2:]]
        blocks = shown.shape[1]
        own_blocks = blocks if not found[2].outputs else 1
        sizes = (online.networks, blocks, own_blocks, observation, message or observation)
        self._net = DCCNet(*sizes, dtype == torch.uint8, message is not None, *found)
        self._loss = torch.zeros(online.networks, batch_size)
        self._q = torch.zeros(online.networks, 2 * batch_size, found[-1].outputs)
        self._outcome = outcome(self._loss, self._q)
        self._scratch: dict[int, Tensor] = {}

    def minimise(
        self, minibatch: Minibatch, factors: InputFactors, step: int
    ) -> tuple[Tensor, Tensor]:
        """Adam's `step`-th step, from 1; factors: of this step's and the next step's inputs.

        Returns the losses [G, B] and Q of the online networks [G, 2B, A], kept until the next call.
        """
        size = self._loss.shape[1]
        blocks = self._shown.shape[1]
        assert all(each.shape[1] in (1, size) and each.shape[2] == blocks for each in factors)
        self._functions.dcc_update(
            byref(self._net),
            byref(self._parameters),
            byref(_memory(minibatch)),
            (Factors * 3)(*map(_factors, factors)),
            byref(DCCRule(self._gamma, self._huber, adam(self._learning_rate, step), size)),
            self._buffers(2 * size),
            byref(self._outcome),
        )
        return self._loss, self._q

    def q_values(
        self, obs: Tensor, messages: Tensor | None, factor: Tensor, shown: Tensor
    ) -> Tensor:
        """Q of the online networks, [G, E, A]; obs [R, E, K, O], factor [G, E, 1+S, 1].

        messages: [R, E, K, M]; None: the observations. shown: [N, 1+S], which of the K are agent
        i's own and its messages.
        """
        rows, blocks = obs.shape[1], (obs if messages is None else messages).shape[2]
        obs = obs.to(self._dtype).contiguous()
        if blocks > obs.shape[2]:  # only messages are old ones, so there are more of them
            obs = pad(obs, (0, 0, 0, blocks - obs.shape[2]))
        q = torch.empty(self._q.shape[0], rows, self._q.shape[2])
        memory = DCCMemory(obs=pointer(obs), shown=pointer(shown))
        if messages is not None:
            memory.messages = pointer(messages)
        memory.agents, memory.obs_blocks = len(shown), blocks
        self._functions.dcc_q_values(
            byref(self._net),
            byref(self._parameters),
            byref(memory),
            byref(_factors(factor)),
            c_int64(rows),
            c_int64(_CHUNK),
            self._buffers(_CHUNK),
            pointer(q),
        )
        return q

    def _buffers(self, rows: int) -> c_void_p:
        """The buffers for so many rows."""
        if rows not in self._scratch:
            size = self._functions.dcc_scratch_bytes(byref(self._net), c_int64(rows))
            self._scratch[rows] = torch.empty(size, dtype=torch.uint8)
        return pointer(self._scratch[rows])


def _factors(factor: Tensor) -> Structure:
    """The stride of rows is 0 where all have the same, the last where a whole block has one."""
    assert factor.shape[-1] == 1 or factor.stride(-1) == 1
    network, row, block, _ = factor.stride()
    strides = (network, row if factor.shape[1] > 1 else 0, block, int(factor.shape[-1] > 1))
    return Factors(factor.data_ptr(), *strides)


def _memory(m: Minibatch) -> Structure:
    parts = (m.obs, m.next_row, m.action, m.reward, m.discount, m.rows, m.shown)
    messages = None if m.messages is None else pointer(m.messages)
    sizes = (len(m.shown), m.obs.shape[2], m.obs.shape[1], m.discount.shape[1])
    return DCCMemory(*map(pointer, parts), messages, *sizes)
