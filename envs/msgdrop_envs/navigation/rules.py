"""Cooperative navigation: agents spread over landmarks and keep apart (paper, l. 375-382).

The physics are those of `simple_spread` in OpenAI's multi-agent particle environments (MPE, commit
83ba4d1), in units of its world. The rules of one step, in order:
1. Every agent pushes itself with one unit of force, times 5, towards +x, -x, +y or -y, or not.
2. Agents that touch push each other apart along the line between them: 100 times the depth of the
   contact, a softplus of margin 0.001. Landmarks are in nobody's way, and there are no walls.
3. Velocities lose a quarter, gain force times dt (mass 1), and move the agents by velocity times
   dt, dt being 0.1.
4. Every agent receives minus the distance to its nearest landmark, and `collision_penalty` less
   for each other agent that it touches. Only the time limit ends an episode.

Agents at rest and landmarks start anywhere in [-1, 1] x [-1, 1], overlaps allowed. An agent sees
its velocity and position, then where all landmarks and the other agents are; another agent that
is not nearer than `sight` stands as (0, 0).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Literal, NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

from msgdrop_envs.protocol import Metric, Transition

PUSHES = ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
"""(x, y) of the five actions, in the order of MPE's one-hot actions."""
MOST_AGENTS = 1_000
"""Tables of pairs are made of more for minutes, before anything could be said of memory (ours)."""
DT, DAMPING, SENSITIVITY = 0.1, 0.25, 5.0
"""Time of a step, share of the velocity that it loses, force of a push (MPE)."""
CONTACT_FORCE, CONTACT_MARGIN = 100.0, 1e-3
"""Force per unit of depth, and how softly a contact begins (MPE)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The settings of a game; the defaults are the paper's N=8 case (l. 381)."""

    agents: int = 8
    """N (paper l. 381)."""
    landmarks: int = 8
    """L (paper l. 381)."""
    collision_penalty: float = 2.0
    """R2- (paper l. 381)."""
    sight: float = 0.5
    """D; others are seen if strictly nearer (ours: a fifth of the area, as in pursuit)."""
    time_limit: int = 25
    """T, steps (not in the paper; 25 in MADDPG's experiments with MPE)."""
    landmark_order: Literal["fixed", "nearest"] = "fixed"
    """Landmarks as numbered (the paper's words), or each agent's nearest first (PAPER.md)."""
    absolute_locations: bool = False
    """Show where things are in the world (the paper does not say; MPE: seen from the agent)."""
    collision_penalty_once: bool = False
    """Pay R2- once a step however many are touched (ours: for each, as MPE's loop does)."""
    moves_first: bool = False
    """Move with the old velocity, as PettingZoo's MPE does (ours: the new one, OpenAI's MPE)."""
    agent_radius: float = 0.15
    """Half the distance at which two agents touch (MPE; figure 2 b shows 0.155)."""
    cover_radius: float = 0.1
    """A landmark is covered by an agent's centre nearer than this (MPE's `benchmark_data`)."""

    def __post_init__(self) -> None:
        for name in ("agents", "landmarks", "time_limit"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")
        if self.agents > MOST_AGENTS:
            raise ValueError(f"agents must be at most {MOST_AGENTS:,}, not {self.agents:,}")
        for name in ("sight", "agent_radius", "cover_radius"):
            if not 0.0 < getattr(self, name) < inf:
                raise ValueError(f"{name} must be above 0 and finite, not {getattr(self, name)}")
        if not 0.0 <= self.collision_penalty < inf:
            raise ValueError(f"collision_penalty must be 0 or more, not {self.collision_penalty}")
        if self.landmark_order not in ("fixed", "nearest"):
            raise ValueError(f"landmark_order must be fixed or nearest, not {self.landmark_order}")


PAPER = {
    "navigation-n8": Config(),
    "navigation-n10": Config(agents=10, landmarks=10),
}


@dataclass(frozen=True, slots=True)
class State:
    """Everything is (x, y), float32."""

    positions: Tensor
    """[..., N, 2], of the agents."""
    velocities: Tensor
    """[..., N, 2], of the agents."""
    landmarks: Tensor
    """[..., L, 2]"""


class _Away(NamedTuple):
    """From each agent to several things: `way` [..., 2, N, K] and `distance` [..., N, K]."""

    way: Tensor
    distance: Tensor


class Navigation:
    """The batched game; holds lookup tables only, all state is passed in and out."""

    observation_dtype = torch.float32
    actions = len(PUSHES)
    action_size = 0
    step_uniforms = 0
    counts: tuple[str, ...] = ("collisions", "covered")
    final_counts: tuple[str, ...] = ("covered",)
    metrics: Mapping[str, Metric] = {
        "return_per_episode": Metric(
            "return", "episodes", 1.0, "higher", "reward summed over agents and steps"
        ),
        "collisions_per_episode": Metric(
            "collisions", "episodes", 1.0, "lower", "pairs of agents in contact, summed over steps"
        ),
        "landmarks_covered": Metric(
            "covered", "episodes", 1.0, "higher", "of L landmarks, at the end of the episode"
        ),
    }

    def __init__(self, config: Config, device: torch.device) -> None:
        self.config = config
        self.agents = config.agents
        self.time_limit = config.time_limit
        self.reset_uniforms = 2 * (config.agents + config.landmarks)
        self.observation_size = 4 + 2 * config.landmarks + 2 * (config.agents - 1)
        pushes = [[SENSITIVITY * part for part in push] for push in PUSHES]
        self._pushes = torch.tensor(pushes, device=device)
        agents = range(config.agents)
        others = [j for i in agents for j in agents if j != i]
        self._others = torch.tensor(others, dtype=torch.long, device=device)  # [N * (N-1)]

    def reset(self, uniforms: Tensor) -> State:
        """Start games. uniforms: [..., 2 * (N + L)], coordinates of agents, then of landmarks."""
        places = (2.0 * uniforms - 1.0).unflatten(-1, (-1, 2))  # [..., N + L, 2]
        positions, landmarks = places.split([self.agents, self.config.landmarks], -2)
        return State(positions, torch.zeros_like(positions), landmarks)

    def step(self, state: State, actions: Tensor, uniforms: Tensor) -> tuple[State, Transition]:
        """Play one step (the order of things is the module's docstring).

        actions: [..., N] int64, indices of PUSHES; uniforms: [..., 0], nothing is left to chance.
        """
        force = self._pushes[actions] + self._contact_force(self._to_others(state))
        velocities = (1.0 - DAMPING) * state.velocities + DT * force
        moving = state.velocities if self.config.moves_first else velocities
        state = State(state.positions + DT * moving, velocities, state.landmarks)

        others, landmarks = self._to_others(state), self._to_landmarks(state)
        touching = (others.distance < 2.0 * self.config.agent_radius).sum(-1)  # [..., N]
        paid = touching.clamp(max=1) if self.config.collision_penalty_once else touching
        reward = -landmarks.distance.amin(-1) - self.config.collision_penalty * paid
        covered = (landmarks.distance < self.config.cover_radius).any(-2)  # [..., L]
        info = {"collisions": touching.sum(-1) / 2.0, "covered": covered.sum(-1).float()}
        ended = torch.zeros(actions.shape[:-1], dtype=torch.bool, device=actions.device)
        obs = self._observation(state, others, landmarks)
        return state, Transition(obs, reward, (~ended).float(), ended, info)

    def places(self, state: State) -> Tensor:
        """Where the agents are, [..., N, 2]."""
        return state.positions

    def observe(self, state: State) -> Tensor:
        """Velocity, position, landmarks, other agents in increasing order (paper l. 378-379).

        Returns [..., N, 4 + 2L + 2(N-1)] float32.
        """
        return self._observation(state, self._to_others(state), self._to_landmarks(state))

    def _to_others(self, state: State) -> _Away:
        """From each agent to the N-1 others."""
        here = state.positions.mT  # [..., 2, N]
        shape = (self.agents, self.agents - 1)
        there = here.index_select(-1, self._others).unflatten(-1, shape)
        return _away(there - here[..., None])  # [..., 2, N, N-1]

    def _to_landmarks(self, state: State) -> _Away:
        return _away(state.landmarks.mT[..., None, :] - state.positions.mT[..., None])

    def _contact_force(self, others: _Away) -> Tensor:
        """What the others push each agent with: [..., N, 2]; none at distance 0 (ours)."""
        depth = _softplus((2.0 * self.config.agent_radius - others.distance) / CONTACT_MARGIN)
        force = CONTACT_FORCE * CONTACT_MARGIN * depth / others.distance.clamp(min=1e-12)
        return -(force[..., None, :, :] * others.way).sum(-1).mT  # [..., N, 2]

    def _observation(self, state: State, others: _Away, landmarks: _Away) -> Tensor:
        shown = [landmarks.way, others.way]  # [..., 2, N, L] and [..., 2, N, N-1]
        if self.config.absolute_locations:
            shown = [way + state.positions.mT[..., None] for way in shown]
        if self.config.landmark_order == "nearest":
            order = landmarks.distance.sort(dim=-1, stable=True).indices[..., None, :, :]
            shown[0] = shown[0].gather(-1, order.expand_as(shown[0]))
        seen = others.distance < self.config.sight
        shown[1] = shown[1] * seen[..., None, :, :]
        places = [way.movedim(-3, -1).flatten(-2) for way in shown]  # [..., N, 2K]
        return torch.cat((state.velocities, state.positions, *places), -1)


def _away(way: Tensor) -> _Away:
    x, y = way.unbind(-3)
    return _Away(way, (x * x + y * y).sqrt())


def _softplus(x: Tensor) -> Tensor:
    """log(1 + exp(x)), padded to whole SIMD registers.

    The loop's tail computes other last bits, and a game's bits must not depend on how many games
    it is stacked with (test_a_game_is_the_same_in_any_batch).
    """
    padded = functional.pad(x.flatten(), (0, -x.numel() % 64))
    return functional.softplus(padded)[: x.numel()].view_as(x)
