"""Waterworld: pursuers catch food together and shun poison in a unit square (paper, l. 383-394).

A state is what the agents see: the food that was just caught and the poison that was just met are
still in it. The rules of one step, in order (MADRL's, which the paper extends):
1. Food that at least `catchers` pursuers touch, and poison that any pursuer touches, is replaced:
   at a random place outside the obstacle, with a random velocity.
2. Food and poison move by their velocity. At a wall they are turned back, each axis by itself, or
   stop there (`object_walls`).
3. Every pursuer adds `acceleration` x action to its velocity and moves by it. At a wall it stops,
   each axis by itself. There is no friction and no speed limit.
4. Whoever is in contact with the obstacle in the middle has its velocity turned; nobody is moved.
5. Two discs touch if their distance is at most the sum of their radii. Food that at least
   `catchers` pursuers touch is caught: each of them receives `catch_reward`. Everyone who touches
   food receives `touch_reward`, everyone who touches poison pays `poison_penalty`, and all pay
   `action_penalty` x |action|^2. The game never ends by itself.

Pursuers start at rest, everything outside the obstacle. A pursuer sees its position and what its
sensors read (`sensors.py`). In here coordinates stand first and games last, since that is fastest:
[2, entities, games].
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from msgdrop_envs import waiting
from msgdrop_envs.protocol import Metric, Transition
from msgdrop_envs.waterworld.config import PAPER as PAPER
from msgdrop_envs.waterworld.config import Config
from msgdrop_envs.waterworld.places import outside
from msgdrop_envs.waterworld.planes import dot, games_first, games_last
from msgdrop_envs.waterworld.sensors import Sensors


@dataclass(frozen=True, slots=True)
class State:
    """(x, y) in the unit square, float32: the pursuers, then the food, then the poison."""

    positions: Tensor
    """[..., N + M + L, 2]"""
    velocities: Tensor
    """[..., N + M + L, 2], per step."""


class Waterworld:
    """The batched game; holds tables only, all state is passed in and out."""

    observation_dtype = torch.float32
    actions = 0
    action_size = 2
    counts: tuple[str, ...] = ("catches", "touches", "poison_met")
    final_counts: tuple[str, ...] = ()
    metrics: Mapping[str, Metric] = {
        "catches_per_500": Metric(
            "catches", "steps", 500.0, "higher", "food catches in 500 env steps, an episode"
        ),
        "touches_per_500": Metric(
            "touches", "steps", 500.0, "higher", "steps of a pursuer in which it touches food"
        ),
        "poison_per_500": Metric("poison_met", "steps", 500.0, "lower", "poison that was met"),
        "return_per_episode": Metric(
            "return", "episodes", 1.0, "higher", "reward summed over agents and steps"
        ),
    }

    def __init__(self, config: Config, device: torch.device) -> None:
        self.config = config
        self.agents = config.pursuers
        self.time_limit = config.time_limit
        objects = config.food + config.poison
        self.reset_uniforms = 2 * config.pursuers + 4 * objects
        self.step_uniforms = 4 * objects
        self._sensors = Sensors(config, device)
        self.observation_size = self._sensors.size
        self._foods = slice(0, config.food)
        self._poisons = slice(config.food, objects)

        def table(pursuer: float, food: float, poison: float) -> Tensor:
            """One number for each entity: [N + M + L, 1]."""
            numbers = [pursuer] * config.pursuers + [food] * config.food + [poison] * config.poison
            return torch.tensor(numbers, device=device)[:, None]

        radii = config.radii
        self._reach = table(*((config.radius + r) ** 2 for r in radii))[self.agents :]  # squared
        self._berth = table(*map(config.berth, radii))
        self._rim = table(*((config.obstacle_radius + r) ** 2 for r in radii))  # squared
        self._speed = table(0.0, config.food_speed, config.poison_speed)[self.agents :]
        wall = -1.0 if config.object_walls == "turn" else 0.0
        self._wall = table(0.0, wall, wall)
        self._bounce = table(-0.5, -0.5 if config.food_bounce == "half" else -1.0, -1.0)

    def reset(self, uniforms: Tensor) -> State:
        """Start games. uniforms: [..., 2N + 4(M+L)], numbers for all places and velocities.

        The first 2N place the pursuers; each food and poison takes four, as in a step.
        """
        batch = uniforms.shape[:-1]
        numbers = uniforms.reshape(math.prod(batch), self.reset_uniforms)
        places, objects = numbers.split([2 * self.agents, self.step_uniforms], -1)
        objects = objects.unflatten(-1, (-1, 4))  # [B, M+L, 4]
        places = torch.cat((places.unflatten(-1, (-1, 2)), objects[..., :2]), 1)
        positions = outside(places, self._berth[:, 0])  # [B, N+M+L, 2]
        velocities = torch.zeros_like(positions)
        velocities[:, self.agents :] = (objects[..., 2:] - 0.5) * self._speed
        shape = (*batch, *positions.shape[1:])
        return State(positions.view(shape), velocities.view(shape))

    def step(self, state: State, actions: Tensor, uniforms: Tensor) -> tuple[State, Transition]:
        """Play one step (the order of things is the module's docstring).

        actions: [..., N, 2] float32 in [-1, 1], x and y; uniforms: [..., 4(M+L)], for the place
        (two) and the velocity (two) of each food and poison, used only where one is replaced.
        """
        batch = actions.shape[:-2]
        push = games_last(actions)
        positions, velocities = games_last(state.positions), games_last(state.velocities)
        self._replace(positions, velocities, uniforms)
        positions, velocities = self._move(positions, velocities, push)
        touch, caught, met = self._contacts(positions)
        on_food, on_poison = touch[:, self._foods], touch[:, self._poisons]
        touches = on_food.any(1).float()  # [N, B]
        reward = (
            self.config.catch_reward * self._paid(on_food & caught)
            + self.config.touch_reward * self._paid(on_food)
            - self.config.poison_penalty * self._paid(on_poison)
            - self.config.action_penalty * dot(push, push)
        )
        counts = (caught.sum(0).float(), touches.sum(0), met.sum(0).float())
        goes_on = torch.ones(batch, device=reward.device)
        transition = Transition(
            self._sensors.read(positions, velocities, touch).view(
                *batch, self.agents, self.observation_size
            ),
            reward.t().reshape(*batch, self.agents),
            goes_on,
            goes_on == 0,
            {n: count.view(batch) for n, count in zip(self.counts, counts, strict=True)},
        )
        return State(games_first(positions, batch), games_first(velocities, batch)), transition

    def places(self, state: State) -> Tensor:
        """Where the pursuers are, in sides of the square: [..., N, 2]."""
        return state.positions[..., : self.agents, :]

    def observe(self, state: State) -> Tensor:
        """Position and what the sensors read, [..., N, O] float32 (paper l. 389-390)."""
        positions, velocities = games_last(state.positions), games_last(state.velocities)
        touch, _, _ = self._contacts(positions)
        obs = self._sensors.read(positions, velocities, touch)
        return obs.view(*state.positions.shape[:-2], self.agents, self.observation_size)

    def _replace(self, positions: Tensor, velocities: Tensor, uniforms: Tensor) -> None:
        """Give caught food and met poison a new place and velocity, in place."""
        _, caught, met = self._contacts(positions)
        gone = torch.cat((caught, met)).t()  # [B, M+L]
        numbers = uniforms.reshape(*gone.shape, 4)
        berth, speed = self._berth[self.agents :, 0], self._speed
        if waiting.can_ask(gone):  # a shortcut, never another result
            game, which = gone.nonzero().unbind(1)
            if len(game) == 0:
                return
            numbers, berth, speed = numbers[game, which], berth[which], speed[which]
        places, speeds = outside(numbers[..., :2], berth), (numbers[..., 2:] - 0.5) * speed
        for old, new in ((positions, places), (velocities, speeds)):
            if waiting.can_ask(gone):
                old[:, self.agents + which, game] = new.t()
            else:  # all get a place, and some take it
                objects = old[:, self.agents :].permute(2, 1, 0)  # [B, M+L, 2]
                objects.copy_(torch.where(gone[..., None], new, objects))

    def _move(self, positions: Tensor, velocities: Tensor, push: Tensor) -> tuple[Tensor, Tensor]:
        """Everybody by its velocity; then the walls, then the obstacle. velocities change."""
        velocities[:, : self.agents] += self.config.acceleration * push
        goal = positions + velocities
        moved = goal.clamp(0, 1)
        velocities = torch.where(goal == moved, velocities, velocities * self._wall)
        away = moved - 0.5
        at_rim = dot(away, away) <= self._rim  # [N+M+L, B]
        return moved, torch.where(at_rim, velocities * self._bounce, velocities)

    def _contacts(self, positions: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Who touches what [N, M+L, B], which food is caught [M, B], which poison is met [L, B]."""
        away = positions[:, None, self.agents :] - positions[:, : self.agents, None]
        touch = dot(away, away) <= self._reach
        enough = touch[:, self._foods].sum(0) >= self.config.catchers
        return touch, enough, touch[:, self._poisons].any(0)

    def _paid(self, touch: Tensor) -> Tensor:
        """How many times each pursuer is paid for these contacts: [N, B]."""
        return (touch.any(1) if self.config.rewards_once else touch.sum(1)).float()
