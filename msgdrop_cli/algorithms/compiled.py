"""DCC's update and Q-values in C (`dcc.c`): the same rule, one agent after the other.

Where there is no C compiler, on a GPU, and for settings that the C file does not know, the learner
takes its torch path, which is also the oracle (tests/test_compiled.py). No rule stands here, only
where the numbers lie.
"""

from ctypes import CDLL, Structure, byref, c_float, c_int64, c_void_p
from pathlib import Path
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from msgdrop_cli.algorithms.protocol import Batch
from msgdrop_cli.networks.inputs import InMemory
from msgdrop_cli.networks.kernel import load
from msgdrop_cli.networks.products import LANES, Adam, Layer, Numbers, adam, each, layers, structure
from msgdrop_cli.networks.stacked import Network, Stacked
from msgdrop_envs.protocol import Environment

if TYPE_CHECKING:
    from msgdrop_cli.algorithms.dcc import DCC

NAME = "c-dcc"
SOURCE = Path(__file__).with_name("dcc.c")
_CHUNK = 64
"""Rows at a time when nothing is learnt: an agent's weights are read once for so many."""

_Net = structure(
    "Net",
    **each(c_int64, "networks blocks own_blocks units bytes factors"),
    **each(Layer, "f1 f2 g1 h1 h2"),
)
_Seen = structure("Seen", **each(c_void_p, "obs rows shown"), **each(c_int64, "group row_blocks"))
_Factor = structure("Factor", values=c_void_p, **each(c_int64, "network row"))
_Batch = structure("Batch", **each(c_void_p, "action reward discount loss q"))
_Rule = structure("Rule", **each(c_float, "gamma huber"), adam=Adam)


def library(
    network: Network, env: Environment, max_gradient_norm: float, device: torch.device | str
) -> CDLL | None:
    """The C functions, or None where the torch path has to do.

    Every width must be a multiple of LANES, and there must be no more actions.
    A clipped gradient has to be known as a whole before the step, which is not how the file works.
    """
    *hidden, actions = (outputs for _, outputs in network.layers.values())
    known = (
        torch.device(device).type == "cpu"
        and env.observation_dtype in (torch.uint8, torch.float32)
        and all(width % LANES == 0 for width in hidden)
        and actions <= LANES
        and max_gradient_norm == 0
    )
    return load(SOURCE) if known else None


class Compiled:
    """The C functions for one learner's weights and moments, which stay where they are."""

    def __init__(self, functions: CDLL, learner: "DCC", env: Environment) -> None:
        self._functions, self._config = functions, learner.config
        functions.scratch_bytes.restype = c_int64
        self._shown = learner.shown_agents
        blocks = self._shown.shape[1]
        self._in_order = torch.arange(blocks)
        layers = _layers(learner.online)
        own_blocks = layers[0].inputs // env.observation_size
        sizes = (learner.online.networks, blocks, own_blocks, env.observation_size)
        self._net = _Net(*sizes, env.observation_dtype == torch.uint8, 1, *layers)
        self._dtype = env.observation_dtype
        moments = learner.adam.moments
        parts = (learner.online, moments["exp_avg"], moments["exp_avg_sq"], learner.target)
        self._numbers = Numbers(*(part.flat.data_ptr() for part in parts))
        size, actions = self._config.batch_size, env.actions
        self._loss = torch.zeros(learner.online.networks, size)
        self._q = torch.zeros(learner.online.networks, 2 * size, actions)
        self._scratch: dict[int, Tensor] = {}

    def minimise(self, batch: Batch, factor: Tensor, step: int) -> tuple[Tensor, Tensor]:
        """Adam's `step`-th step, from 1; factor [G, 2B, 1+S, 1 or O].

        Returns the losses [G, B] and Q of the online networks [G, 2B, A], kept until the next call.
        """
        config = self._config
        obs = batch.obs
        if isinstance(obs, Tensor):
            obs = obs.to(self._dtype).contiguous()
        given = [part.contiguous() for part in (batch.action, batch.reward, batch.discount)]
        rule = _Rule(config.gamma, config.loss == "huber", adam(config.learning_rate, step))
        self._functions.update(
            byref(self._net),
            byref(self._numbers),
            byref(self._seen(obs)),
            byref(self._factor(factor)),
            byref(_Batch(*(array.data_ptr() for array in (*given, self._loss, self._q)))),
            byref(rule),
            c_int64(config.batch_size),
            self._memory(2 * config.batch_size),
        )
        return self._loss, self._q

    def q_values(self, obs: Tensor, factor: Tensor) -> Tensor:
        """Q of the online networks, [G, E, A]; obs [R, E, N, O], factor [G, E, 1+S, 1 or O]."""
        rows, obs = obs.shape[1], obs.to(self._dtype).contiguous()
        q = torch.empty(self._q.shape[0], rows, self._q.shape[2])
        seen = _Seen(
            obs.data_ptr(), None, self._shown.data_ptr(), *self._shown.shape[:1], obs.shape[2]
        )
        self._functions.q_values(
            byref(self._net),
            byref(self._numbers),
            byref(seen),
            byref(self._factor(factor)),
            c_int64(rows),
            c_int64(_CHUNK),
            self._memory(_CHUNK),
            c_void_p(q.data_ptr()),
        )
        return q

    def _seen(self, obs: Tensor | InMemory) -> Structure:
        """Joint rows in the replay memory, or a copy of what each network is shown."""
        if isinstance(obs, InMemory):
            memory, agents = obs.memory, obs.memory.shape[1]
            pointers = (memory.data_ptr(), obs.rows.data_ptr(), obs.shown.data_ptr())
            return _Seen(*pointers, agents, agents)
        return _Seen(obs.data_ptr(), None, self._in_order.data_ptr(), 1, obs.shape[2])

    def _factor(self, factor: Tensor) -> Structure:
        self._net.factors = factor.shape[-1]
        return _Factor(factor.data_ptr(), factor.stride(0), factor.stride(1))

    def _memory(self, rows: int) -> c_void_p:
        """The buffers for so many rows."""
        if rows not in self._scratch:
            size = self._functions.scratch_bytes(byref(self._net), c_int64(rows))
            self._scratch[rows] = torch.empty(size, dtype=torch.uint8)
        return c_void_p(self._scratch[rows].data_ptr())


def _layers(weights: Stacked) -> list[Structure]:
    """f1, f2, g1, h1, h2; a perceptron has no g."""
    found = list(layers(weights).values())
    return found if len(found) == 5 else [*found[:2], Layer(), *found[2:]]
