"""The masked input of a network, and observations that still lie in the replay memory."""

from dataclasses import dataclass

from torch import Tensor

from msgdrop_cli.ops.message_dropout import apply_keep


@dataclass(frozen=True, slots=True)
class InMemory:
    """A minibatch's observations where they were stored: what to read, not yet a copy of it."""

    memory: Tensor
    """[rows, N, O]: joint observations."""
    rows: Tensor
    """[G, B] int64, contiguous: the joint rows that each network is shown."""
    shown: Tensor
    """[N, 1+S] int64: the agents in them that agent i is shown."""

    def gathered(self) -> Tensor:
        """The copy, [G, B, 1+S, O]."""
        agents, observation = self.memory.shape[1:]
        blocks = self.rows.view(-1, agents, self.rows.shape[1], 1) * agents + self.shown[:, None]
        obs = self.memory.view(-1, observation).index_select(0, blocks.flatten())
        return obs.view(*self.rows.shape, self.shown.shape[1], observation)


def gathered(obs: Tensor | InMemory) -> Tensor:
    """The observations as a tensor."""
    return obs.gathered() if isinstance(obs, InMemory) else obs


def masked_input(blocks: Tensor, factor: Tensor) -> Tensor:
    """The input of a network: blocks [G, B, 1+S, O] times factor [G, B, 1+S, 1 or O]."""
    # A GPU casts while it multiplies; the CPU falls off its fast path (benchmarks/NOTES.md).
    return apply_keep(blocks if blocks.is_cuda else blocks.float(), factor).flatten(2)
