"""Cooperative navigation once more, slowly, in plain Python: the yardstick of `test_navigation.py`.

Written from the rules alone (paper l. 375-382, PAPER.md; where they leave something open
the docstring of `navigation.py`), one game at a time, agent by agent, in double precision. Speed
and elegance do not matter here; that each line can be held against a sentence of the rules does.
"""

import math
from dataclasses import dataclass

Point = tuple[float, float]
DIRECTIONS: list[Point] = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)]


@dataclass
class Outcome:
    """What one step gives: one list entry for each agent, one number for each game."""

    observations: list[list[float]]
    rewards: list[float]
    collisions: int
    covered: int


@dataclass
class SlowNavigation:
    """One game."""

    sight: float
    collision_penalty: float
    collision_penalty_once: bool
    landmark_order: str
    absolute_locations: bool
    moves_first: bool
    agent_radius: float
    cover_radius: float
    positions: list[Point]
    velocities: list[Point]
    landmarks: list[Point]

    def step(self, actions: list[int]) -> Outcome:
        """Play one step: forces, then velocities, then places, then the bill."""
        forces = [self._force_on(agent, DIRECTIONS[action]) for agent, action in enumerate(actions)]
        for agent, force in enumerate(forces):
            old, place = self.velocities[agent], self.positions[agent]
            new = (old[0] * 0.75 + force[0] * 0.1, old[1] * 0.75 + force[1] * 0.1)
            used = old if self.moves_first else new
            self.velocities[agent] = new
            self.positions[agent] = (place[0] + used[0] * 0.1, place[1] + used[1] * 0.1)
        return Outcome(
            self.observe(),
            [self._reward(agent) for agent in range(len(self.positions))],
            self._collisions(),
            self._covered(),
        )

    def _force_on(self, agent: int, direction: Point) -> Point:
        force_x, force_y = direction[0] * 5.0, direction[1] * 5.0
        for other in self._others(agent):
            apart = math.dist(self.positions[agent], self.positions[other])
            if apart == 0.0:
                continue  # no line between them to be pushed along
            depth = log_one_plus_exp((2 * self.agent_radius - apart) / 0.001) * 0.001
            force_x += 100.0 * depth * (self.positions[agent][0] - self.positions[other][0]) / apart
            force_y += 100.0 * depth * (self.positions[agent][1] - self.positions[other][1]) / apart
        return force_x, force_y

    def _reward(self, agent: int) -> float:
        nearest = min(math.dist(self.positions[agent], landmark) for landmark in self.landmarks)
        touched = sum(self._touch(agent, other) for other in self._others(agent))
        if self.collision_penalty_once and touched > 0:
            touched = 1
        return -nearest - self.collision_penalty * touched

    def _collisions(self) -> int:
        count = 0
        for agent in range(len(self.positions)):
            for other in range(agent):
                count += self._touch(agent, other)
        return count

    def _covered(self) -> int:
        count = 0
        for landmark in self.landmarks:
            if any(math.dist(place, landmark) < self.cover_radius for place in self.positions):
                count += 1
        return count

    def _touch(self, agent: int, other: int) -> bool:
        apart = math.dist(self.positions[agent], self.positions[other])
        return apart < self.agent_radius + self.agent_radius

    def _others(self, agent: int) -> list[int]:
        return [other for other in range(len(self.positions)) if other != agent]

    def observe(self) -> list[list[float]]:
        """For each agent its velocity, its position, all landmarks, all others."""
        return [self._seen_by(agent) for agent in range(len(self.positions))]

    def _seen_by(self, agent: int) -> list[float]:
        here = self.positions[agent]
        landmarks = list(self.landmarks)
        if self.landmark_order == "nearest":
            landmarks.sort(key=lambda landmark: math.dist(here, landmark))
        numbers = [*self.velocities[agent], *here]
        for landmark in landmarks:
            numbers += self._shown(here, landmark)
        for other in self._others(agent):
            if math.dist(here, self.positions[other]) < self.sight:
                numbers += self._shown(here, self.positions[other])
            else:
                numbers += (0.0, 0.0)
        return numbers

    def _shown(self, here: Point, there: Point) -> Point:
        if self.absolute_locations:
            return there
        return there[0] - here[0], there[1] - here[1]


def log_one_plus_exp(x: float) -> float:
    """The softplus, without overflow."""
    return max(x, 0.0) + math.log1p(math.exp(-abs(x)))
