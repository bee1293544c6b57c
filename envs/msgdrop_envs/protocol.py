"""What every environment offers. Randomness comes in as uniform numbers, nothing draws for itself.

Letters: `...` any leading batch dimensions (runs, parallel games), `N` agents, `O` observation.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor

from msgdrop_envs.drawing import Disc
from msgdrop_envs.metric import Metric as Metric  # part of what a game imports from here


class Transition(NamedTuple):
    """What one step gives."""

    obs: Tensor
    """[..., N, O]: what each agent sees after the step, before any reset."""
    reward: Tensor
    """[..., N] float32: each agent its own."""
    discount: Tensor
    """[...] float32: 0 at a true end of the game, 1 otherwise; a time limit keeps 1."""
    ended: Tensor
    """[...] bool: the episode is over, by a true end or (added by `autoreset`) the time limit."""
    info: Mapping[str, Tensor]
    """Counts of what happened in the step, [...] float32 each; summed up by the metrics.

    Of `final_counts` it holds what the position shows; `autoreset` lets only the last one count.
    """


class Baseline(NamedTuple):
    """A policy that learns nothing and may see everything: a line that a learner has to cross."""

    act: Callable[[Any, Tensor], Tensor]
    """(State, uniforms [..., N, max(1, action_size)]) to actions, as `Environment.step` takes."""
    meaning: str


class Environment(Protocol):
    """One game's rules for any number of games at once."""

    agents: int
    observation_size: int
    observation_dtype: torch.dtype
    """There may be `observation_channels`, too: names of equal parts of what is seen, in order."""
    actions: int
    """What an agent can choose from; 0 where an action is `action_size` numbers."""
    action_size: int
    """Numbers in [-1, 1] that make an action; 0 where it is one of `actions`."""
    time_limit: int
    reset_uniforms: int
    """How many uniform numbers in [0, 1) one reset takes."""
    step_uniforms: int
    """How many uniform numbers in [0, 1) one step takes."""
    metrics: Mapping[str, Metric]
    """Name to formula; the first one is the headline of tables, figures and progress."""
    counts: tuple[str, ...]
    """The keys of `Transition.info`."""
    final_counts: tuple[str, ...]
    """Those of `counts` that describe a position: only an episode's last one counts."""

    def reset(self, uniforms: Tensor) -> Any:
        """Start games; uniforms [..., reset_uniforms]; returns a State."""

    def step(self, state: Any, actions: Tensor, uniforms: Tensor) -> tuple[Any, Transition]:
        """Play one step; uniforms [..., step_uniforms].

        actions: [..., N] int64, or [..., N, action_size] float32.
        """

    def observe(self, state: Any) -> Tensor:
        """What each agent sees, [..., N, O].

        There may be `places(state)`, too: where the agents are, [..., N, 2] in the game's unit, for
        channels such as `within`.
        """


class View(Protocol):
    """One game without batch dimensions, for people; its states are the environment's own."""

    version: int
    """Bumped with every change of dynamics, reward or observation."""
    agent_names: tuple[str, ...]
    observation_bounds: tuple[float, float]
    """The least and the largest number that an observation can hold."""
    state_bounds: tuple[float, float]
    """The same of a state."""

    def state_from_dict(self, given: Any) -> Any:
        """Read a state from plain lists and numbers; ValueError where it is none."""

    def state_to_dict(self, state: Any) -> dict[str, Any]:
        """Write a state as `state_from_dict` reads it."""

    def render_rgb(self, state: Any) -> Tensor:
        """A picture [height, width, 3] uint8."""

    def scene(self, state: Any) -> list[Disc]:
        """Who and what is where: the agents first, in their order."""

    def render_text(self, state: Any) -> str:
        """A few lines of text."""


def random_play(env: Environment) -> Baseline:
    """Every agent anything, at every step."""
    if env.action_size:
        return Baseline(lambda state, uniforms: 2.0 * uniforms - 1.0, "any push, every step")
    return Baseline(
        lambda state, uniforms: (uniforms[..., 0] * env.actions).long(), "any action, every step"
    )
