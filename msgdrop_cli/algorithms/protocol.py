"""What the engine asks of every learner, and what it hands over."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from torch import Tensor

from msgdrop_cli.networks.inputs import InMemory


class Batch(NamedTuple):
    """A minibatch for every network; G = R*N, the own observation first among the 1 + S blocks.

    For a `joint` learner, one for every run, of joint transitions: all agents in order.
    """

    obs: Tensor | InMemory
    """[G, 2*B, 1+S, O]: the B observations, then the B next ones, as stored; joint [R, 2*B, N, O].
    """
    action: Tensor
    """[G, B] int64; joint [R, B, N] int64, or [R, B, N, A] float32 if actions are continuous."""
    reward: Tensor
    """[G, B] float32; joint [R, B, N]."""
    discount: Tensor
    """[G, B] float32: 0 at a true end, else 1; joint [R, B]."""


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

    def update(self, batch: Batch, uniforms: Tensor) -> None:
        """Learn from one minibatch; uniforms [R, update_uniforms]."""

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

    @staticmethod
    def kernel(config: Any, env: Any, device: Any) -> str:
        """The name of what such a learner computes with: equal names, equal bits."""

    def __call__(self, configs: Sequence[Any], env: Any, device: Any) -> Learner:
        """Build the learner for `env` (its agents, observation_size, actions and action_size)."""
