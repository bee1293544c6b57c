"""MADDPG's update and actions in C (`maddpg.c`): the same rule, one run after the other.

It knows the critic h(f, g), and DDPG's without g, if all agents share the networks. Elsewhere,
without a C compiler and on a GPU, the learner takes its torch path, which is also the oracle
(tests/test_compiled_maddpg.py). No rule stands here, only where the numbers lie.
"""

from ctypes import CDLL, Structure, byref, c_float, c_int64, c_void_p
from pathlib import Path
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from msgdrop_cli.algorithms.soft_target import SoftTarget
from msgdrop_cli.networks.kernel import load
from msgdrop_cli.networks.products import LANES, Adam, Layer, Numbers, adam, each, layers, structure
from msgdrop_cli.ops.minibatch import Minibatch
from msgdrop_envs.protocol import Environment

if TYPE_CHECKING:
    from msgdrop_cli.algorithms.maddpg import MADDPG, Config

NAME = "c-maddpg"
SOURCE = Path(__file__).with_name("maddpg.c")

_Net = structure(
    "Net",
    **each(c_int64, "runs agents observation action senders masks_actions"),
    **each(Layer, "a1 a2 f1 f2 g1 h1 h2"),
)
_Memory = structure(
    "Memory",
    **each(c_void_p, "obs next_row action reward discount rows"),
    **each(c_int64, "obs_rows run_rows"),
)
_Rule = structure("Rule", **each(c_float, "gamma tau max_norm"), **each(Adam, "critic actor"))


def library(config: "Config", env: Environment, device: torch.device | str) -> CDLL | None:
    """The C functions, or None where the torch path has to do."""
    widths = (*config.f_units, config.g_units)
    known = (
        torch.device(device).type == "cpu"
        and config.shares_parameters
        and config.network != "concat"
        and all(width % LANES == 0 or width >= 3 * LANES for width in widths)
        and config.h_units % LANES == config.actor_units % LANES == 0
        and env.action_size <= LANES
        and env.observation_dtype == torch.float32
    )
    return load(SOURCE) if known else None


class Compiled:
    """The C functions for one learner's weights and moments, which stay where they are."""

    def __init__(self, learner: "MADDPG", env: Environment) -> None:
        functions = load(SOURCE)
        assert functions is not None
        self._functions, self._config = functions, learner.config
        functions.scratch_bytes.restype = c_int64
        runs, size = learner.actors.online.networks, learner.config.batch_size
        sizes = (runs, env.agents, env.observation_size, env.action_size, learner.critic.hears)
        first, last = layers(learner.actors.online).values()
        self._net = _Net(
            *sizes,
            learner.config.masks_actions,
            a1=first,
            a2=last,
            **layers(learner.critics.online),
        )
        self._actors, self._critics = _numbers(learner.actors), _numbers(learner.critics)
        self._loss, self._q = torch.zeros(2, runs, size * env.agents)
        memory = functions.scratch_bytes(byref(self._net), c_int64(size))
        self._scratch = torch.empty(memory, dtype=torch.uint8)

    def improve(
        self, minibatch: Minibatch, keep: Tensor, critic_step: int, actor_step: int | None
    ) -> tuple[Tensor, Tensor]:
        """Improve the critics, and the actors too unless their step is None.

        keep: [R, N, B, S, 1], the binary mask, contiguous; the steps are Adam's, from 1.
        Returns the losses and Q of the online critics, [R, B*N] each, kept until the next call.
        """
        config = self._config
        rule = _Rule(
            *(config.gamma, config.tau, config.max_gradient_norm),
            adam(config.learning_rate, critic_step),
            adam(config.learning_rate, actor_step or 1),
        )
        self._functions.update(
            byref(self._net),
            byref(self._actors),
            byref(self._critics),
            byref(_memory(minibatch)),
            c_void_p(keep.data_ptr()),
            byref(rule),
            c_int64(config.batch_size),
            c_int64(actor_step is not None),
            c_void_p(self._scratch.data_ptr()),
            c_void_p(self._loss.data_ptr()),
            c_void_p(self._q.data_ptr()),
        )
        return self._loss, self._q

    def actions(self, obs: Tensor) -> Tensor:
        """The actors' actions without noise, [R, E, N, A]; obs [R, E, N, O]."""
        found = torch.empty(*obs.shape[:3], self._net.action)
        obs = obs.contiguous()
        self._functions.actions(
            byref(self._net),
            c_void_p(self._actors.weights),
            c_void_p(obs.data_ptr()),
            c_int64(obs.shape[1]),
            c_int64(self._config.batch_size),
            c_void_p(self._scratch.data_ptr()),
            c_void_p(found.data_ptr()),
        )
        return found


def _memory(m: Minibatch) -> Structure:
    parts = (m.obs, m.next_row, m.action, m.reward, m.discount, m.rows)
    assert all(part.is_contiguous() for part in parts)
    return _Memory(*(part.data_ptr() for part in parts), m.obs.shape[1], m.discount.shape[1])


def _numbers(half: SoftTarget) -> Structure:
    parts = half.parts()
    names = ("online", "exp_avg", "exp_avg_sq", "target")
    return Numbers(*(parts[name].flat.data_ptr() for name in names))
