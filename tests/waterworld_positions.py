"""Positions of waterworld, made by hand or at random, and one step from them."""

import math
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from msgdrop_envs.protocol import Transition
from msgdrop_envs.waterworld.config import Config
from msgdrop_envs.waterworld.rules import State, Waterworld
from tests.slow_waterworld import Disc, SlowWaterworld, Vector

FAR = (0.02, 0.02)
"""Where whatever a test does not speak of rests."""
NOWHERE = 0.4375
"""A uniform number."""


def build(config: Config) -> Waterworld:
    """The batched game."""
    return Waterworld(config, torch.device("cpu"))


def state_of(*discs: tuple[Vector, Vector]) -> State:
    """A State of one game: (place, velocity) of the pursuers, then food, then poison."""
    return State(
        torch.tensor([place for place, _ in discs]),
        torch.tensor([velocity for _, velocity in discs]),
    )


def at_rest(*places: Vector) -> list[tuple[Vector, Vector]]:
    """Discs that do not move."""
    return [(place, (0.0, 0.0)) for place in places]


def play(
    config: Config,
    discs: Sequence[tuple[Vector, Vector]],
    actions: Sequence[Vector] | None = None,
) -> tuple[State, Transition]:
    """One step of one game; without actions nobody accelerates."""
    env = build(config)
    given = torch.tensor(actions) if actions else torch.zeros(config.pursuers, 2)
    return env.step(state_of(*discs), given, torch.full((env.step_uniforms,), NOWHERE))


def random_states(config: Config, games: int, generator: torch.Generator) -> State:
    """Games in which much is near: pursuers and others crowd around two foods."""
    entities = config.pursuers + config.food + config.poison
    places = torch.rand(games, entities, 2, generator=generator)
    noise = torch.randn(games, entities, 2, generator=generator)
    share = torch.rand(games, 1, 1, generator=generator) ** 2
    # This share of all things crowds around the first two foods of its game.
    centre = torch.randint(2, (games, entities, 1), generator=generator).expand(-1, -1, 2)
    foods = places[:, config.pursuers :].clone()
    crowded = torch.rand(games, entities, 1, generator=generator) < share
    velocities = 0.02 * torch.randn(games, entities, 2, generator=generator)
    near = foods.gather(1, centre) + 0.06 * noise
    near = 1 - (1 - near.abs()).abs()  # folded back at the walls
    return State(torch.where(crowded, near, places), velocities)


def closing_in(state: State, config: Config, generator: torch.Generator) -> State:
    """The same with the pursuers of every third game in a ring, about to touch the first food."""
    pursuers, (games, entities, _) = config.pursuers, state.positions.shape
    angles = 2 * math.pi * torch.rand(games, pursuers, generator=generator)
    inwards = torch.stack((angles.cos(), angles.sin()), -1)  # [B, N, 2]
    reach = (1 + config.food_size) * config.radius
    apart = reach + 0.02 * torch.rand(games, pursuers, 1, generator=generator)
    food = state.positions[:, pursuers, None]
    placed = (torch.arange(games) % 3 == 0)[:, None, None] & (torch.arange(entities) < pursuers)[
        None, :, None
    ]
    positions, velocities = state.positions.clone(), state.velocities.clone()
    positions[:, :pursuers] = (food - apart * inwards).clamp(0, 1)
    velocities[:, :pursuers] = 0.015 * inwards
    return State(
        torch.where(placed, positions, state.positions),
        torch.where(placed, velocities, state.velocities),
    )


def slow_games(config: Config, state: State) -> list[SlowWaterworld]:
    """The slow games in exactly these states [B, ...]."""
    games = []
    for places, speeds in zip(state.positions.tolist(), state.velocities.tolist(), strict=True):
        discs = [Disc(tuple(p), tuple(v)) for p, v in zip(places, speeds, strict=True)]
        first, second = config.pursuers, config.pursuers + config.food
        games.append(SlowWaterworld(config, discs[:first], discs[first:second], discs[second:]))
    return games


def state_from_slow(games: Sequence[SlowWaterworld]) -> tuple[Tensor, Tensor]:
    """Positions and velocities of the slow games, float64: [B, N + M + L, 2] each."""
    discs = [(*game.pursuers, *game.food, *game.poison) for game in games]
    places = [[disc.place for disc in row] for row in discs]
    velocities = [[disc.velocity for disc in row] for row in discs]
    return (
        torch.tensor(places, dtype=torch.float64),
        torch.tensor(velocities, dtype=torch.float64),
    )


def sensor_block(obs: Tensor, config: Config) -> Tensor:
    """The readings [..., N, 3 classes, 2 (distance, velocity), S] of observations [..., N, O]."""
    readings = obs[..., 2 : 2 + 6 * config.sensors]
    return readings.view(*readings.shape[:-1], 3, 2, config.sensors)


def params(**changes: Any) -> Config:
    """A small game: one of everything, no obstacle to speak of, raw sensors; and changes."""
    small: dict[str, Any] = {
        "pursuers": 1,
        "catchers": 1,
        "food": 1,
        "poison": 1,
        "obstacle_radius": 0.0,
        "sensors_scaled": False,
    }
    return Config(**(small | changes))
