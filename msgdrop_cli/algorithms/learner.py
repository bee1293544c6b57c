"""What the engine asks of every learner."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from torch import Tensor

from msgdrop_cli.algorithms.cohort import RunningMeans
from msgdrop_cli.algorithms.hearing import Encoding
from msgdrop_cli.messages.received import Heard
from msgdrop_cli.ops.minibatch import Minibatch


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
    """Whether all agents of a run learn from the same joint transitions (see `Minibatch`)."""
    shown_agents: Tensor
    """[N, 1+S] int64: whom agent i is shown, itself first, then the senders in increasing order."""
    encoding: Encoding
    """What the agents say of what they see."""
    means: RunningMeans
    """Every run's losses and Q-values since `metrics` was called last."""
    init_uniforms: int
    """Uniform numbers that the initial weights of one run take."""
    act_uniforms: int
    """Uniform numbers that one agent's action in one game takes."""
    update_uniforms: int
    """Uniform numbers that one update of one run takes."""

    def initialise(self, uniforms: Tensor) -> None:
        """Make new weights; uniforms [R, init_uniforms]."""

    def act(
        self, obs: Tensor, uniforms: Tensor, env_steps: int | Tensor, received: Heard = None
    ) -> Tensor:
        """Behave in training; obs [R, E, N, O], uniforms [R, E, N, act_uniforms].

        received: what arrives of the messages; None: everything.
        env_steps: after how many; a float64 tensor [] in steps that are recorded to be repeated,
        which are never before the replay start.
        Returns [R, E, N] int64, or [R, E, N, A] float32 if actions are continuous.
        """

    def act_greedily(self, obs: Tensor, received: Heard = None) -> Tensor:
        """Behave in execution, by what arrives of the messages; None: everything."""

    def update(self, minibatch: Minibatch, uniforms: Tensor) -> None:
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
