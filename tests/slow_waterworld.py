"""Waterworld once more, slowly, in plain Python: the yardstick of `test_waterworld.py`.

Written from the rules alone (the docstrings of `rules.py` and `sensors.py`), one
game at a time, sensor by sensor and object by object, in Python's 64-bit floats. Where the answer
hangs on a comparison, the slow game also tells how far the nearest one was from going the other
way: 32-bit floats may decide differently only there.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from msgdrop_envs.waterworld.config import Config

Vector = tuple[float, float]


@dataclass
class Disc:
    """A pursuer, food or poison."""

    place: Vector
    velocity: Vector


class Reading(NamedTuple):
    """What one sensor reads of one class of objects."""

    distance: float
    velocity: float
    margin: float
    """How little would have changed the object that is read."""


@dataclass
class Outcome:
    """What one step gives: one reward for each pursuer, counts for the game."""

    rewards: list[float]
    catches: int
    touches: int
    poison_met: int
    margin: float
    """How near the closest decision of the step was."""


@dataclass
class SlowWaterworld:
    """One game."""

    config: Config
    pursuers: list[Disc] = field(default_factory=list)
    food: list[Disc] = field(default_factory=list)
    poison: list[Disc] = field(default_factory=list)
    margin: float = math.inf

    def start(self, uniforms: Sequence[float]) -> None:
        """Begin anew: two numbers for each pursuer, four for each food and poison."""
        config, numbers = self.config, iter(uniforms)
        self.pursuers = [
            Disc(self.free_place(next(numbers), next(numbers), config.radius), (0.0, 0.0))
            for _ in range(config.pursuers)
        ]
        self.food = [self.new_food(numbers) for _ in range(config.food)]
        self.poison = [self.new_poison(numbers) for _ in range(config.poison)]

    def step(self, actions: Sequence[Vector], uniforms: Sequence[float]) -> Outcome:
        """Play one step: replace, objects, pursuers, obstacle, contacts."""
        self.margin = math.inf
        self._replace(uniforms)
        for thing in (*self.food, *self.poison):
            self._drift(thing)
        for pursuer, action in zip(self.pursuers, actions, strict=True):
            self._drive(pursuer, action)
        self._obstacle()
        return self._bill(actions)

    def new_food(self, numbers: Iterator[float]) -> Disc:
        """Food where and as fast as four uniform numbers say."""
        place = self.free_place(next(numbers), next(numbers), self.food_radius)
        speed = self.config.food_speed
        return Disc(place, ((next(numbers) - 0.5) * speed, (next(numbers) - 0.5) * speed))

    def new_poison(self, numbers: Iterator[float]) -> Disc:
        """Poison where and as fast as four uniform numbers say."""
        place = self.free_place(next(numbers), next(numbers), self.poison_radius)
        speed = self.config.poison_speed
        return Disc(place, ((next(numbers) - 0.5) * speed, (next(numbers) - 0.5) * speed))

    @property
    def food_radius(self) -> float:
        """Of each food."""
        return self.config.radius * self.config.food_size

    @property
    def poison_radius(self) -> float:
        """Of each poison."""
        return self.config.radius * self.config.poison_size

    def free_place(self, first: float, second: float, radius: float) -> Vector:
        """The place that two uniform numbers pick, found by bisection instead of Newton's rule.

        The first number picks a side of the square and, within it, the share of free area that
        lies between the one diagonal and the place; the second the share of free area along the
        ray from the middle that is nearer to it.
        """
        clear = self.config.obstacle_radius + 2 * radius
        side = int(first * 4)
        wanted = first * 4 - side

        def free_area(slope: float) -> float:
            """Of a side, from the slope -1 on: triangle minus sector, each counted from -1."""
            triangle = 0.5 * 0.5 * (slope + 1) / 2
            sector = clear**2 * (math.atan(slope) + math.pi / 4) / 2
            return triangle - sector

        low, high = -1.0, 1.0
        for _ in range(60):
            slope = (low + high) / 2
            if free_area(slope) < wanted * free_area(1.0):
                low = slope
            else:
                high = slope
        near = clear / math.sqrt(1 + slope**2)  # of the side's axis, where the disc ends
        along = math.sqrt(near**2 + second * (0.5**2 - near**2))
        across = along * slope
        x, y = [(along, across), (-along, across), (across, along), (across, -along)][side]
        return 0.5 + x, 0.5 + y

    def read(self) -> list[list[list[Reading]]]:
        """For each pursuer, for allies, food and poison, for each sensor: what it reads."""
        return [
            [
                self._look(me, [p for p in self.pursuers if p is not me], self.config.radius),
                self._look(me, self.food, self.food_radius),
                self._look(me, self.poison, self.poison_radius),
            ]
            for me in self.pursuers
        ]

    def _look(self, me: Disc, things: list[Disc], radius: float) -> list[Reading]:
        width = radius if self.config.sensor_width == "object" else self.config.radius
        length = self.config.sensor_range
        relative = [
            (
                thing.place[0] - me.place[0],
                thing.place[1] - me.place[1],
                thing.velocity[0] - me.velocity[0],
                thing.velocity[1] - me.velocity[1],
            )
            for thing in things
            if math.dist(thing.place, me.place) < length + width + 0.01  # else no sensor meets it
        ]
        if not relative:
            return [Reading(0.0, 0.0, math.inf)] * self.config.sensors
        readings = []
        for number in range(self.config.sensors):
            angle = 2 * math.pi * number / self.config.sensors
            east, north = math.cos(angle), math.sin(angle)
            best, margin, velocity = math.inf, math.inf, 0.0
            for x, y, vx, vy in relative:
                along = x * east + y * north
                if along < -0.01:
                    continue  # clearly behind
                aside = math.sqrt(max(x * x + y * y - along * along, 0.0))
                inside = min(along, length - along, width - aside)
                if inside < 0:
                    margin = min(margin, -inside)
                    continue
                margin = min(margin, inside, abs(along - best))
                if along < best:
                    best, velocity = along, vx * east + vy * north
            readings.append(Reading(0.0 if best == math.inf else best, velocity, margin))
        return readings

    def _near(self, here: Vector, there: Vector, distance: float) -> bool:
        """Whether two places are at most this far apart."""
        apart = math.dist(here, there)
        self.margin = min(self.margin, abs(apart - distance))
        return apart <= distance

    def _touching(self, thing: Disc, radius: float) -> list[int]:
        """The pursuers that touch it."""
        reach = self.config.radius + radius
        return [i for i, p in enumerate(self.pursuers) if self._near(p.place, thing.place, reach)]

    def _replace(self, uniforms: Sequence[float]) -> None:
        foods, poisons = len(self.food), len(self.poison)
        quads = [iter(uniforms[4 * i : 4 * i + 4]) for i in range(foods + poisons)]
        caught = [
            len(self._touching(food, self.food_radius)) >= self.config.catchers
            for food in self.food
        ]
        met = [bool(self._touching(poison, self.poison_radius)) for poison in self.poison]
        for i in range(foods):
            if caught[i]:
                self.food[i] = self.new_food(quads[i])
        for i in range(poisons):
            if met[i]:
                self.poison[i] = self.new_poison(quads[foods + i])

    def _drift(self, thing: Disc) -> None:
        """Food and poison are turned back at walls, or stop there."""
        factor = -1 if self.config.object_walls == "turn" else 0
        places, velocities = [], []
        for place, velocity in zip(thing.place, thing.velocity, strict=True):
            goal = place + velocity
            self.margin = min(self.margin, abs(goal), abs(goal - 1)) if velocity else self.margin
            if goal < 0:
                goal, velocity = 0.0, factor * velocity
            elif goal > 1:
                goal, velocity = 1.0, factor * velocity
            places.append(goal)
            velocities.append(velocity)
        thing.place, thing.velocity = (places[0], places[1]), (velocities[0], velocities[1])

    def _drive(self, pursuer: Disc, action: Vector) -> None:
        """Pursuers accelerate, and stop at walls."""
        places, velocities = [], []
        axes = zip(pursuer.place, pursuer.velocity, action, strict=True)
        for place, old, push in axes:
            velocity = old + self.config.acceleration * push
            goal = place + velocity
            if velocity:
                self.margin = min(self.margin, abs(goal), abs(goal - 1))
            if goal < 0:
                goal, velocity = 0.0, 0.0
            elif goal > 1:
                goal, velocity = 1.0, 0.0
            places.append(goal)
            velocities.append(velocity)
        pursuer.place, pursuer.velocity = (places[0], places[1]), (velocities[0], velocities[1])

    def _obstacle(self) -> None:
        food_factor = -0.5 if self.config.food_bounce == "half" else -1.0
        for things, radius, factor in (
            (self.pursuers, self.config.radius, -0.5),
            (self.food, self.food_radius, food_factor),
            (self.poison, self.poison_radius, -1.0),
        ):
            for thing in things:
                if self._near(thing.place, (0.5, 0.5), radius + self.config.obstacle_radius):
                    thing.velocity = (factor * thing.velocity[0], factor * thing.velocity[1])

    def _bill(self, actions: Sequence[Vector]) -> Outcome:
        config = self.config
        catchers: list[int] = []  # pursuer, once for each food that it helps to catch
        touchers: list[int] = []
        poisoned: list[int] = []
        catches = poison_met = 0
        for food in self.food:
            by = self._touching(food, self.food_radius)
            touchers += by
            if len(by) >= config.catchers:
                catches += 1
                catchers += by
        for poison in self.poison:
            by = self._touching(poison, self.poison_radius)
            poisoned += by
            poison_met += bool(by)
        touches = len(set(touchers))
        if config.rewards_once:
            catchers, touchers, poisoned = list(set(catchers)), list(set(touchers)), [*{*poisoned}]
        rewards = [
            config.catch_reward * catchers.count(i)
            + config.touch_reward * touchers.count(i)
            - config.poison_penalty * poisoned.count(i)
            - config.action_penalty * (action[0] ** 2 + action[1] ** 2)
            for i, action in enumerate(actions)
        ]
        return Outcome(rewards, catches, touches, poison_met, self.margin)
