"""What calls maddpg.c: updates and actions of actors and critics that all agents of a run share."""

from collections.abc import Mapping
from ctypes import Structure, byref, c_int64

import torch
from torch import Tensor

from msgdrop_cli.kernels.build import library
from msgdrop_cli.kernels.structs import (
    LANES,
    Layer,
    MADDPGMemory,
    MADDPGNet,
    MADDPGRule,
    adam,
    layers,
    outcome,
    parameters,
    pointer,
)
from msgdrop_cli.networks.stacked import Layers, Stacked
from msgdrop_cli.ops.minibatch import Minibatch

NAME = "c-maddpg-fma"


def serves(
    networks: tuple[Layers, ...],
    observation: int,
    action: int,
    dtype: torch.dtype,
    *,
    shared: bool,
    device: torch.device | str,
) -> bool:
    """Whether maddpg.c was written for such an actor, critic and inputs, and is there.

    The agents must share the networks. First layers and f's second one may have any width from
    3 * LANES on, the others a multiple of LANES; there must be no more numbers of an action.
    """
    actor, critic = networks
    widths = [outputs for _, outputs in critic.values()]
    wide, narrow = widths[:-2], [widths[-2], next(iter(actor.values()))[1]]
    known = (
        torch.device(device).type == "cpu"
        and shared
        and all(width % LANES == 0 or width >= 3 * LANES for width in wide)
        and all(width % LANES == 0 for width in narrow)
        and action <= LANES
        and observation + action < 2**16  # nonzeros.h numbers them in two bytes
        and dtype == torch.float32
    )
    return known and library() is not None


class MADDPGKernel:
    """Updates and actions of R actors and critics whose weights and moments stay where they are."""

    def __init__(
        self,
        actors: Mapping[str, Stacked],
        critics: Mapping[str, Stacked],
        *,
        agents: int,
        senders: int,
        masks_actions: bool,
        batch_size: int,
        learning_rate: float,
        gamma: float,
        tau: float,
        max_gradient_norm: float,
    ) -> None:
        """actors, critics: online, target, exp_avg, exp_avg_sq of each."""
        functions = library()
        assert functions is not None
        functions.maddpg_scratch_bytes.restype = c_int64
        self._functions, self._size, self._learning_rate = functions, batch_size, learning_rate
        self._rule = (gamma, tau, max_gradient_norm)
        self._actors, self._critics = parameters(actors), parameters(critics)
        first, last = layers(actors["online"]).values()
        critic = list(layers(critics["online"]).values())  # f1, f2, g1, h1, h2; some have no g
        critic = critic if len(critic) == 5 else [*critic[:2], Layer(), *critic[2:]]
        runs = actors["online"].networks
        sizes = (runs, agents, first.inputs, last.outputs, senders, masks_actions)
        self._net = MADDPGNet(*sizes, first, last, *critic)
        self._loss, self._q = torch.zeros(2, runs, batch_size * agents)
        self._outcome = outcome(self._loss, self._q)
        memory = functions.maddpg_scratch_bytes(byref(self._net), c_int64(batch_size))
        self._scratch = torch.empty(memory, dtype=torch.uint8)

    def improve(
        self, minibatch: Minibatch, keep: Tensor, critic_step: int, actor_step: int | None
    ) -> tuple[Tensor, Tensor]:
        """Improve the critics, and the actors too unless their step is None.

        keep: [R, N, B, S, 1], the binary mask; the steps are Adam's, from 1.
        Returns the losses and Q of the online critics, [R, B*N] each, kept until the next call.
        """
        rule = MADDPGRule(
            *self._rule,
            adam(self._learning_rate, critic_step),
            adam(self._learning_rate, actor_step or 1),
            self._size,
            actor_step is not None,
        )
        self._functions.maddpg_update(
            byref(self._net),
            byref(self._actors),
            byref(self._critics),
            byref(_memory(minibatch)),
            pointer(keep),
            byref(rule),
            pointer(self._scratch),
            byref(self._outcome),
        )
        return self._loss, self._q

    def actions(self, obs: Tensor) -> Tensor:
        """The actors' actions without noise, [R, E, N, A]; obs [R, E, N, O]."""
        found = torch.empty(*obs.shape[:3], self._net.action)
        obs = obs.contiguous()
        self._functions.maddpg_actions(
            byref(self._net),
            byref(self._actors),
            pointer(obs),
            c_int64(obs.shape[1]),
            c_int64(self._size),
            pointer(self._scratch),
            pointer(found),
        )
        return found


def _memory(m: Minibatch) -> Structure:
    parts = (m.obs, m.next_row, m.action, m.reward, m.discount, m.rows)
    return MADDPGMemory(*map(pointer, parts), m.obs.shape[1], m.discount.shape[1])
