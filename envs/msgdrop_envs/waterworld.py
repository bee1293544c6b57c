"""Waterworld: pursuers catch food together and shun poison in a unit square (paper, l. 383-394).

A state is what the agents see: the food that was just caught and the poison that was just met are
still in it. The rules of one step, in order (MADRL's, which the paper extends):
1. Food that at least `catchers` pursuers touch, and poison that any pursuer touches, is replaced:
   at a random place outside the obstacle, with a random velocity.
2. Food and poison move by their velocity. At a wall they are turned back, each axis by itself.
3. Every pursuer adds `acceleration` x action to its velocity and moves by it. At a wall it stops,
   each axis by itself. There is no friction and no speed limit.
4. Whoever is in contact with the obstacle in the middle has its velocity turned; nobody is moved.
5. Two discs touch if their distance is at most the sum of their radii. Food that at least
   `catchers` pursuers touch is caught: each of them receives `catch_reward`. Everyone who touches
   food receives `touch_reward`, everyone who touches poison pays `poison_penalty`, and all pay
   `action_penalty` x |action|^2. The game never ends by itself.

Pursuers start at rest, everything outside the obstacle. A pursuer sees its position and what its
sensors read (`waterworld_sensors.py`). In here coordinates stand first and games last, since that
is fastest: [2, entities, games].
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import torch
from torch import Tensor

from msgdrop_envs import waiting
from msgdrop_envs.protocol import Metric, Reference, Transition
from msgdrop_envs.waterworld_places import outside
from msgdrop_envs.waterworld_planes import dot, games_first, games_last
from msgdrop_envs.waterworld_sensors import Sensors

if TYPE_CHECKING:
    from msgdrop_envs.waterworld_view import WaterworldView


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The settings of a game; the defaults are the paper's N=8 case (l. 394).

    Lengths are in sides of the square. "Figure" is figure 2c of the paper, measured.
    """

    pursuers: int = 8
    """N (paper l. 394)."""
    catchers: int = 4
    """K, pursuers that must touch a food at once (paper l. 394)."""
    food: int = 10
    """M (figure; MADRL's runner)."""
    poison: int = 10
    """L (figure; MADRL's runner)."""
    radius: float = 0.02
    """Of a pursuer (figure; MADRL has 0.015)."""
    food_size: float = 2.0
    """Radius of food in radii of a pursuer (figure; MADRL)."""
    poison_size: float = 0.75
    """Radius of poison in radii of a pursuer (figure; MADRL)."""
    obstacle_radius: float = 0.2
    """Of the obstacle in the middle of the square (figure; MADRL)."""
    sensors: int = 25
    """Sensors of a pursuer, evenly around it, the first to the east (paper l. 389)."""
    sensor_range: float = 0.15
    """Length of a sensor (figure; MADRL has 0.2)."""
    sensor_width: Literal["own", "object"] = "own"
    """A sensor meets an object whose centre is within this radius of it: the pursuer's (MADRL) or
    the object's (PettingZoo)."""
    sensors_scaled: bool = True
    """Show position x 2 - 1, distance / range, velocity / `velocity_unit`; raw learns slower."""
    velocity_unit: float = 0.02
    """What is shown as velocity 1 if scaled (ours: of the order that pursuers reach)."""
    senses_obstacle: bool = False
    """Also show a distance to the obstacle for each sensor (MADRL; the paper names none)."""
    senses_touch: bool = False
    """Also show whether food, and whether poison, is touched (MADRL; the paper names none)."""
    time_limit: int = 500
    """T, steps (paper l. 394)."""
    catch_reward: float = 10.0
    """R1+, to every pursuer that touches a caught food (paper l. 394)."""
    touch_reward: float = 0.01
    """R2+, to every pursuer that touches a food (paper l. 394)."""
    poison_penalty: float = 0.1
    """R1-, to every pursuer that touches a poison (paper l. 394)."""
    rewards_once: bool = True
    """Pay each kind of reward at most once a step, as MADRL does, even for two foods."""
    action_penalty: float = 5e-5
    """Times |action|^2 (paper l. 393: the "square norm of the action", no factor; MADRL: 0.5 times
    that of the acceleration). The literal 1.0 would swamp all rewards but R1+."""
    acceleration: float = 0.01
    """Change of velocity in a step by an action of 1 (MADRL)."""
    food_speed: float = 0.01
    """Each axis of a new food's velocity is uniform within half of this around 0 (MADRL)."""
    poison_speed: float = 0.01
    """The same for poison (MADRL)."""
    food_bounce: Literal["half", "full"] = "half"
    """At the obstacle food's velocity v becomes -v / 2 (MADRL; it may stay at the rim) or -v."""

    def __post_init__(self) -> None:
        for name in ("pursuers", "catchers", "food", "sensors", "time_limit"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")
        for name in ("radius", "food_size", "poison_size", "sensor_range", "velocity_unit"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be above 0, not {getattr(self, name)}")
        for name in ("poison", "obstacle_radius", "food_speed", "poison_speed"):
            if not getattr(self, name) >= 0:
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        if self.catchers > self.pursuers:
            raise ValueError(f"catchers must be at most the {self.pursuers} pursuers")
        if max(map(self.berth, self.radii)) >= 0.5:
            raise ValueError("the obstacle and twice the largest radius must stay below 0.5")

    @property
    def radii(self) -> tuple[float, float, float]:
        """Of a pursuer, a food, a poison."""
        return self.radius, self.food_size * self.radius, self.poison_size * self.radius

    def berth(self, radius: float) -> float:
        """How far from the middle something of this radius begins (MADRL)."""
        return self.obstacle_radius + 2 * radius

    def build(self, device: torch.device) -> "Waterworld":
        """The batched game with these rules on `device`."""
        return Waterworld(self, device)


PAPER = {
    "waterworld-n8": Config(),
    "waterworld-n10": Config(pursuers=10, catchers=5),
}


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
        self._wall = table(0.0, -1.0, -1.0)
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

    def observe(self, state: State) -> Tensor:
        """Position and what the sensors read, [..., N, O] float32 (paper l. 389-390)."""
        positions, velocities = games_last(state.positions), games_last(state.velocities)
        touch, _, _ = self._contacts(positions)
        obs = self._sensors.read(positions, velocities, touch)
        return obs.view(*state.positions.shape[:-2], self.agents, self.observation_size)

    def references(self) -> Mapping[str, Reference]:
        """Policies that learn nothing, by name."""
        from msgdrop_envs.waterworld_references import references  # it imports this module

        return references(self)

    def view(self) -> "WaterworldView":
        """How one game is named, written down and drawn (`parallel.py` asks)."""
        from msgdrop_envs.waterworld_view import WaterworldView  # it imports this module

        return WaterworldView(self.config)

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
