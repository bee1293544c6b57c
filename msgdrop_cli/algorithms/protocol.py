"""What the engine asks of every learner, and what it hands over."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor


class Batch(NamedTuple):
    """A minibatch for every network; G = R*N, the own observation first among the 1 + S blocks.

    For a `joint` learner, one for every run, of joint transitions: all agents in order.
    """

    obs: Tensor
    """[G, 2*B, 1+S, O]: the B observations, then the B next ones, as stored; joint [R, 2*B, N, O].
    """
    action: Tensor
    """[G, B] int64; joint [R, B, N] int64, or [R, B, N, A] float32 if actions are continuous."""
    reward: Tensor
    """[G, B] float32; joint [R, B, N]."""
    discount: Tensor
    """[G, B] float32: 0 at a true end, else 1; joint [R, B]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """Minibatches where they lie in the memories of R runs: what to read, not yet a copy of it."""

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

    def batch(self) -> Batch:
        """The copy."""
        return self._joint_batch() if self.rows.dim() == 2 else self._batch()

    def _batch(self) -> Batch:
        runs, agents, size = self.rows.shape
        run = torch.arange(runs, device=self.rows.device)[:, None, None]
        agent = torch.arange(agents, device=self.rows.device)[:, None]
        taken = run * self.discount.shape[1] + self.rows  # [R, N, B], `take` reads flat memories
        both = torch.cat((self.rows, self.next_row.take(taken)), -1) + run * self.obs.shape[1]
        blocks = both[..., None] * agents + self.shown[:, None]  # [R, N, 2B, 1+S]
        obs = self.obs.view(-1, self.obs.shape[-1]).index_select(0, blocks.flatten())
        own = torch.add(agent, taken, alpha=agents)
        return Batch(
            obs=obs.view(runs * agents, 2 * size, self.shown.shape[1], -1),
            action=self.action.take(own).flatten(0, 1).long(),
            reward=self.reward.take(own).flatten(0, 1),
            discount=self.discount.take(taken).flatten(0, 1),
        )

    def _joint_batch(self) -> Batch:
        run = torch.arange(len(self.rows), device=self.rows.device)[:, None]
        taken = run * self.discount.shape[1] + self.rows  # [R, B]
        both = torch.cat((self.rows, self.next_row.take(taken)), -1) + run * self.obs.shape[1]
        action = self.action.flatten(0, 1)[taken]
        return Batch(
            obs=self.obs.flatten(0, 1)[both],
            action=action if action.is_floating_point() else action.long(),
            reward=self.reward.flatten(0, 1)[taken],
            discount=self.discount.take(taken),
        )


class Pace(Protocol):
    """The fields of every learner's Config that the engine reads."""

    @property
    def batch_size(self) -> int:
        """Transitions an agent and update."""

    @property
    def replay_capacity(self) -> int:
        """Transitions in each agent's memory."""

    @property
    def replay_start_env_steps(self) -> int:
        """Env steps before the first update."""

    @property
    def update_every_env_steps(self) -> int:
        """Env steps between two updates."""


class Learner(Protocol):
    """The networks of R runs of N agents, and the rule that improves them."""

    @property
    def config(self) -> Pace:
        """The Config that the runs share."""

    joint: bool
    """Whether all agents of a run learn from the same joint transitions (see `Batch`)."""
    shown_agents: Tensor
    """[N, 1+S] int64: whom agent i is shown, itself first, then the senders in increasing order."""
    init_uniforms: int
    """Uniform numbers that the initial weights of one run take."""
    act_uniforms: int
    """Uniform numbers that one agent's action in one game takes."""
    update_uniforms: int
    """Uniform numbers that one update of one run takes."""

    def initialise(self, uniforms: Tensor) -> None:
        """Make new weights; uniforms [R, init_uniforms]."""

    def act(self, obs: Tensor, uniforms: Tensor, env_steps: int | Tensor) -> Tensor:
        """Behave in training; obs [R, E, N, O], uniforms [R, E, N, act_uniforms].

        env_steps: after how many; a float64 tensor [] in steps that are recorded to be repeated,
        which are never before the replay start.
        Returns [R, E, N] int64, or [R, E, N, A] float32 if actions are continuous.
        """

    def act_greedily(self, obs: Tensor, keep: Tensor | None = None) -> Tensor:
        """Behave in execution; keep [R, E, N, S] says which messages arrive."""

    def update(self, batch: Batch | Drawn, uniforms: Tensor) -> None:
        """Learn from one minibatch, or one for each network; uniforms [R, update_uniforms]."""

    def does_more(self, update: int) -> bool:
        """Whether update number `update`, from 0, does what only some do, such as a copy."""

    def metrics(self, env_steps: int) -> list[dict[str, float | None]]:
        """Each run's means since the last call; not a number where the run diverged."""

    def tensors(self, run: int) -> Mapping[str, Tensor]:
        """Views of everything a run's training goes on from, for checkpoints."""

    def policy(self, run: int) -> Mapping[str, Tensor]:
        """Views of what execution needs."""

    @property
    def progress(self) -> tuple[int, ...]:
        """Counters that a checkpoint keeps."""

    def resume_at(self, *counters: int) -> None:
        """Set the counters of `progress` again."""


class LearnerFactory(Protocol):
    """A learner's class: built from the runs' Configs, which may differ in `rate` only."""

    listens: bool
    """Whether trained agents hear each other when they act, so that broken links can matter."""

    @classmethod
    def kernel(cls, config: Any, env: Any, device: Any) -> str:
        """The name of what such a learner computes with: equal names, equal bits."""

    def __call__(self, configs: Sequence[Any], env: Any, device: Any) -> Learner:
        """Build the learner for `env` (its agents, observation_size, actions and action_size)."""
