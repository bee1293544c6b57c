"""Hand-made positions of navigation and one step from them, for the tests of its rules."""

from dataclasses import asdict
from typing import Any

import torch
from torch import Tensor

from msgdrop_envs.navigation.rules import Config, Navigation, State
from msgdrop_envs.protocol import Transition
from tests.slow_navigation import Point, SlowNavigation

NOTHING, EAST, WEST, NORTH, SOUTH = range(5)
FAR: Point = (9.0, 9.0)
"""A landmark that is in nobody's way."""


def position(
    agents: list[Point], landmarks: list[Point], velocities: list[Point] | None = None
) -> State:
    """A State of one game without batch dimensions; without velocities all are at rest."""
    moving = velocities or [(0.0, 0.0)] * len(agents)
    return State(*(torch.tensor(each, dtype=torch.float32) for each in (agents, moving, landmarks)))


def play(
    agents: list[Point],
    landmarks: list[Point],
    actions: list[int] | None = None,
    velocities: list[Point] | None = None,
    **config: Any,
) -> tuple[State, Transition]:
    """One step of a game; without actions nobody pushes."""
    rules = Config(agents=len(agents), landmarks=len(landmarks), **config)
    return Navigation(rules, torch.device("cpu")).step(
        position(agents, landmarks, velocities),
        torch.tensor(actions or [NOTHING] * len(agents)),
        torch.zeros(0),
    )


def seen(obs: Tensor, agents: int, agent: int = 0) -> tuple[list[Point], list[Point]]:
    """What an agent sees of landmarks and of others, as points rounded to five digits."""
    numbers = [round(number, 5) for number in obs[agent, 4:].tolist()]
    points = list(zip(numbers[::2], numbers[1::2], strict=True))
    return points[: 1 - agents or None], points[len(points) + 1 - agents :]


def slow_games(config: Config, state: State) -> list[SlowNavigation]:
    """The slow games that stand where the games of a batch [B, ...] stand."""
    rules = asdict(config)
    for name in ("agents", "landmarks", "time_limit"):
        del rules[name]
    parts = (state.positions.tolist(), state.velocities.tolist(), state.landmarks.tolist())
    return [
        SlowNavigation(
            **rules,
            positions=[(x, y) for x, y in positions],
            velocities=[(x, y) for x, y in velocities],
            landmarks=[(x, y) for x, y in landmarks],
        )
        for positions, velocities, landmarks in zip(*parts, strict=True)
    ]
