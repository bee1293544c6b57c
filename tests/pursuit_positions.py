"""Hand-made positions of pursuit and one step from them, for the tests of its rules."""

import dataclasses
from typing import Any

import torch
from torch import Tensor

from msgdrop_envs.protocol import Transition
from msgdrop_envs.pursuit.rules import Config, Pursuit, State
from tests.slow_pursuit import Cell, SlowPursuit

NORTH, EAST, WEST, SOUTH, STAY = range(5)
RING: list[Cell] = [(4, 5), (5, 6), (5, 4), (6, 5)]
"""The four sides of (5, 5)."""


def uniform(move: int) -> float:
    """A uniform number that picks this one of the five moves."""
    return (move + 0.5) / 5


def position(pursuers: list[Cell], evaders: list[Cell | None]) -> State:
    """A State of one game without batch dimensions; None is a captured evader."""
    return State(
        torch.tensor(pursuers),
        torch.tensor([evader or (0, 0) for evader in evaders]),
        torch.tensor([evader is not None for evader in evaders]),
    )


def play(
    pursuers: list[Cell],
    evaders: list[Cell | None],
    actions: list[int] | None = None,
    evader_moves: list[int] | None = None,
    **config: Any,
) -> tuple[State, Transition]:
    """One step of a game; without moves everybody stays."""
    rules = Config(pursuers=len(pursuers), evaders=len(evaders), **config)
    env = Pursuit(rules, torch.device("cpu"))
    return env.step(
        position(pursuers, evaders),
        torch.tensor(actions or [STAY] * len(pursuers)),
        torch.tensor([uniform(move) for move in evader_moves or [STAY] * len(evaders)]),
    )


def slow_game(config: Config, pursuers: list[Cell], evaders: list[Cell | None]) -> SlowPursuit:
    """The slow game with the same rules."""
    return SlowPursuit(
        size=config.map_size,
        sight=config.sight,
        capture_reward=config.capture_reward,
        step_penalty=config.step_penalty,
        edge_penalty=config.edge_penalty,
        capture_reward_once=config.capture_reward_once,
        may_enter_evaders=config.may_enter_evaders,
        may_share_cells=config.may_share_cells,
        pursuers=list(pursuers),
        evaders=list(evaders),
    )


def stack(states: list[State]) -> State:
    """Single games as one batch."""
    names = [field.name for field in dataclasses.fields(State)]
    return State(*(torch.stack([getattr(state, name) for state in states]) for name in names))


def assert_equal_state(state: State, slow: list[SlowPursuit]) -> None:
    """Positions of the batch and of the slow games agree; where captured evaders lie is free."""
    assert state.pursuers.tolist() == [[list(cell) for cell in game.pursuers] for game in slow]
    for cells, free, game in zip(state.evaders.tolist(), state.free.tolist(), slow, strict=True):
        alive = [tuple(c) if is_free else None for c, is_free in zip(cells, free, strict=True)]
        assert alive == game.evaders


def windows(obs: Tensor) -> dict[tuple[int, int, int], int]:
    """What a pursuer's first two windows hold besides zeros: (channel, row, column) to count."""
    grid = obs.view(3, 7, 7)[:2]
    return {tuple(at): int(grid[tuple(at)]) for at in grid.nonzero().tolist()}
