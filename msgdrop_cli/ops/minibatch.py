"""A minibatch: what was drawn from the memories, and where it lies. `engine/replay.py` fills it.

The kernels read it in the memory; who computes with torch asks for a copy.
Letters: `R` runs, `N` agents, `G = R*N` networks, `B` transitions, `S` senders, `O` observation,
`M` message, `A` numbers of an action.
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

Blocks = tuple[Tensor, ...]
"""What networks see: the own observation first, then messages, [G, B, blocks, numbers] each; one
tensor where they are equally wide."""


class Batch(NamedTuple):
    """A copied minibatch for every network, the own observation first among the 1 + S blocks.

    For a `joint` learner, one for every run, of joint transitions: all agents in order.
    """

    obs: Tensor
    """[G, 2*B, 1+S, O]: the B observations, then the B next ones, as stored; [G, 2*B, 1, O] if
    there are messages; joint [R, 2*B, N, O]."""
    action: Tensor
    """[G, B] int64; joint [R, B, N] int64, or [R, B, N, A] float32 if actions are continuous."""
    reward: Tensor
    """[G, B] float32; joint [R, B, N]."""
    discount: Tensor
    """[G, B] float32: 0 at a true end, else 1; joint [R, B]."""
    messages: Tensor | None = None
    """[G, 2*B, S, M] float32, likewise; None where observations are the messages."""

    def seen(self) -> tuple[Blocks, Blocks]:
        """(o, m) and (o', m')."""
        blocks = (self.obs,) if self.messages is None else (self.obs, self.messages)
        halves = [part.chunk(2, 1) for part in blocks]
        return tuple(now for now, _ in halves), tuple(after for _, after in halves)


@dataclass(frozen=True, slots=True, kw_only=True)
class Minibatch:
    """What the networks of R runs have drawn, where it lies in their memories (l. 215).

    A row of a memory is one joint transition; `obs` has more rows, for what episodes ended with.
    """

    obs: Tensor
    """[R, obs rows, N, O]: joint observations; the rest has fewer rows."""
    next_row: Tensor
    """[R, rows] int32: the row of `obs` that comes next."""
    action: Tensor
    """[R, rows, N] uint8, or [R, rows, N, A] float32"""
    reward: Tensor
    """[R, rows, N] float32"""
    discount: Tensor
    """[R, rows] float32"""
    rows: Tensor
    """[R, N, B] int64: what each network has drawn; joint [R, B]."""
    shown: Tensor
    """[N, 1+S] int64: whom agent i is shown."""
    messages: Tensor | None = None
    """[R, obs rows, N, M] float32: joint messages; None where observations are the messages."""

    arrives: Tensor | None = None
    """[R, obs rows, N, all others] uint8: 0 where no message arrived, else 1 more than its age;
    None where no channel loses any."""

    def arrived(self, links: Tensor) -> tuple[Tensor, Tensor]:
        """What arrived with the drawn observations and with the next ones, [G, B, S] float32.

        links: [N, S], where those who are heard stand among all others.
        """
        assert self.arrives is not None
        agents = torch.arange(len(links), device=links.device)[:, None]
        rows = self._obs_rows() * len(links) + agents  # [R, N, 2B]
        found = self.arrives.flatten(0, 2)[rows]  # [R, N, 2B, all others]
        heard = found.gather(-1, links[:, None].expand(*found.shape[:1], -1, found.shape[2], -1))
        now, after = (heard > 0).float().flatten(0, 1).chunk(2, 1)
        return now, after

    def _run(self) -> Tensor:
        """The number of each run, to be added to `rows`: [R, 1, 1], joint [R, 1]."""
        run = torch.arange(len(self.rows), device=self.rows.device)
        return run.view(-1, *[1] * (self.rows.dim() - 1))

    def _drawn(self) -> Tensor:
        """The drawn rows, counted through all memories, as `take` does: [R, N, B], joint [R, B]."""
        return self._run() * self.discount.shape[1] + self.rows

    def _obs_rows(self) -> Tensor:
        """The same of the observations, then of the next ones: [R, N, 2B], joint [R, 2B]."""
        rows = torch.cat((self.rows, self.next_row.take(self._drawn())), -1)
        return rows + self._run() * self.obs.shape[1]

    def copied(self) -> Batch:
        """The numbers themselves, network by network."""
        return self._joint_batch() if self.rows.dim() == 2 else self._batch()

    def _batch(self) -> Batch:
        agents = self.rows.shape[1]
        agent = torch.arange(agents, device=self.rows.device)[:, None]
        taken = self._drawn()
        blocks = self._obs_rows()[..., None] * self.obs.shape[2] + self.shown[:, None]
        # [R, N, 2B, 1+S]
        own = torch.add(agent, taken, alpha=agents)
        return Batch(
            obs=_taken(self.obs, blocks if self.messages is None else blocks[..., :1]),
            action=self.action.take(own).flatten(0, 1).long(),
            reward=self.reward.take(own).flatten(0, 1),
            discount=self.discount.take(taken).flatten(0, 1),
            messages=None if self.messages is None else _taken(self.messages, blocks[..., 1:]),
        )

    def _joint_batch(self) -> Batch:
        taken = self._drawn()
        action = self.action.flatten(0, 1)[taken]
        return Batch(
            obs=self.obs.flatten(0, 1)[self._obs_rows()],
            action=action if action.is_floating_point() else action.long(),
            reward=self.reward.flatten(0, 1)[taken],
            discount=self.discount.take(taken),
        )


def links_heard(shown: Tensor) -> Tensor:
    """Where the senders of shown [N, 1+S] stand among all others of an agent, [N, S] int64.

    A keep mask has a column for each other agent in increasing order: agent j's is j, or j - 1 for
    those whose number is lower.
    """
    own, heard = shown[:, :1], shown[:, 1:]
    return heard - (heard > own).long()


def seen_in_games(obs: Tensor, messages: Tensor | None, shown: Tensor) -> Blocks:
    """What each network sees in E games; obs [R, E, N, O], messages [R, E, N, M] or None."""
    if messages is None:
        return (obs[:, :, shown].transpose(1, 2).flatten(0, 1),)  # [G, E, 1+S, O]
    parts = ((obs, shown[:, :1]), (messages, shown[:, 1:]))
    return tuple(part[:, :, each].transpose(1, 2).flatten(0, 1) for part, each in parts)


def _taken(memory: Tensor, blocks: Tensor) -> Tensor:
    """The blocks [R, N, 2B, K], counted through all of a memory [R, rows, N, U]: [G, 2B, K, U]."""
    taken = memory.view(-1, memory.shape[-1]).index_select(0, blocks.flatten())
    return taken.view(*blocks.flatten(0, 1).shape, memory.shape[-1])
