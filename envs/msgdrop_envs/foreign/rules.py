"""Any PettingZoo `ParallelEnv` as a batched game: what it sees and does is flat, and of one size.

* A game's state is its seed and what was done since: games that repeat themselves from that go on
  exactly where a checkpoint left them. Others go on with the same episode, played differently.
* An agent that leaves before the others sees zeros from then on, gets nothing, and is not asked.
* The episode ends when nobody is left: truly, with discount 0, unless an agent was truncated in the
  last step, which is a time limit and keeps 1.

Letters: `...` batch dimensions, `T` time limit, `N` agents, `O` observation, `A` action numbers.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from msgdrop_envs.foreign import factory
from msgdrop_envs.foreign.config import Config, in_its_units
from msgdrop_envs.foreign.live import Live
from msgdrop_envs.protocol import Metric, Transition
from msgdrop_envs.registry import GameError

_SEEDS = 2**24
"""As many as uniform numbers tell apart."""


PAPER: Mapping[str, Config] = {}
"""None stands in the paper, and none is known before somebody asks for it."""


@dataclass(frozen=True, slots=True)
class State:
    """Where games stand."""

    place: Tensor
    """[...] int64: which of the games that are kept alive."""
    seed: Tensor
    """[...] int64: of the episode."""
    steps: Tensor
    """[...] int64: played in the episode."""
    actions: Tensor
    """[..., T, N] uint8, or [..., T, N, A] float32: what was done in these steps."""


class Foreign:
    """The batched game; it keeps one live game for each that is played at the same time."""

    observation_dtype = torch.float32
    counts: tuple[str, ...] = ()
    final_counts: tuple[str, ...] = ()
    metrics: Mapping[str, Metric] = {
        "return_per_episode": Metric(
            "return", "episodes", 1.0, "higher", "reward summed over agents and steps"
        ),
    }
    reset_uniforms, step_uniforms = 1, 0

    def __init__(self, config: Config, device: torch.device) -> None:
        if device.type == "cuda":
            raise GameError(f"{config.factory}: games of other people are played with --device cpu")
        self.config = config
        self.agents = len(config.agent_names)
        self.observation_size = config.observation_size
        self.actions, self.action_size = config.actions, len(config.action_low)
        self.time_limit = config.time_limit
        each = (self.action_size,) if self.action_size else ()
        self._action_shape = (self.time_limit, self.agents, *each)
        self._live: dict[int, Live] = {}

    def reset(self, uniforms: Tensor) -> State:
        """Choose the seeds of new episodes; uniforms [..., 1]. They begin when they are seen.

        Raises GameError, before any memory is taken, for a game that the user has not asked for.
        """
        factory.refuse_unasked(self.config.factory)
        batch, device = uniforms.shape[:-1], uniforms.device
        dtype = torch.float32 if self.action_size else torch.uint8
        return State(
            place=torch.arange(batch.numel(), device=device).view(batch),
            seed=(uniforms[..., 0] * _SEEDS).long(),
            steps=torch.zeros(batch, dtype=torch.int64, device=device),
            actions=torch.zeros(*batch, *self._action_shape, dtype=dtype, device=device),
        )

    def observe(self, state: State) -> Tensor:
        """What each agent sees, [..., N, O]; begins what has not begun."""
        seen = torch.stack([live.obs for live in self._games(state)])
        return seen.view(*state.seed.shape, self.agents, self.observation_size)

    def step(self, state: State, actions: Tensor, uniforms: Tensor) -> tuple[State, Transition]:
        """Play one step; actions as in the protocol, uniforms [..., 0]: games draw for themselves.

        Raises GameError for a game that is not what it was, or ends before its time limit by one.
        """
        batch = state.seed.shape
        games = self._games(state)
        flat = actions.flatten(0, len(batch) - 1)
        results = [live.step(each) for live, each in zip(games, flat, strict=True)]
        rewards = torch.stack([result.reward for result in results]).view(*batch, self.agents)
        over = torch.tensor([result.over for result in results]).view(batch)
        cut = torch.tensor([result.cut for result in results]).view(batch)
        done = state.actions.clone()
        rows = torch.arange(batch.numel())
        done.flatten(0, len(batch) - 1)[rows, state.steps.flatten()] = flat.to(done.dtype)
        state = dataclasses.replace(state, steps=state.steps + 1, actions=done)
        seen = torch.stack([live.obs for live in games]).view(*batch, self.agents, -1)
        return state, Transition(seen, rewards, (cut | ~over).float(), over, {})

    def in_its_units(self, actions: Tensor) -> Tensor:
        """What learners do as the game takes it: numbers from its low to its high, [..., A]."""
        return in_its_units(self.config, actions)

    def _games(self, state: State) -> list[Live]:
        """The live games of these states, brought to where they should stand."""
        places, seeds, steps = (
            each.flatten().tolist() for each in (state.place, state.seed, state.steps)
        )
        histories = state.actions.flatten(0, state.seed.dim() - 1)
        found = []
        for number, (place, seed, played) in enumerate(zip(places, seeds, steps, strict=True)):
            if place not in self._live:
                self._live[place] = Live(self.config)
            live = self._live[place]
            if (live.seed, live.steps) != (seed, played):
                live.go_to(seed, histories[number, :played])
            found.append(live)
        return found
