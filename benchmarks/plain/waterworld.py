"""Waterworld: the rules are those of `msgdrop_envs.waterworld`, written once more.

Arrays over all objects and sensors of the one game; pursuers first, then food, then poison.
"""

import numpy as np
import numpy.typing as npt

FOOD, POISON = 10, 10
RADII = (0.02, 0.04, 0.015)
"""Of a pursuer, a food, a poison."""
OBSTACLE = 0.2
SENSORS, SENSOR_RANGE = 25, 0.15
VELOCITY_UNIT = 0.02
"""What is shown as velocity 1."""
ACCELERATION, SPEED = 0.01, 0.01
CATCH, TOUCH, POISONED, ACTION = 10.0, 0.01, -0.1, -5e-5
"""Rewards; the last one times |action|^2."""

Numbers = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class Waterworld:
    """One game."""

    observation = 2 + 6 * SENSORS
    dtype = np.float32
    actions = 0
    action_size = 2
    time_limit = 500

    def __init__(self, agents: int, catchers: int, rng: np.random.Generator) -> None:
        self.agents, self.catchers = agents, catchers
        self.rng = rng
        kinds = np.repeat([0, 1, 2], [agents, FOOD, POISON])
        self.classes = [np.flatnonzero(kinds == kind) for kind in range(3)]
        self.radii = np.array(RADII)[kinds]
        self.bounce = np.array([-0.5, -0.5, -1.0])[kinds]
        self.positions = self.velocities = np.zeros((len(kinds), 2))
        self.gone = np.zeros(FOOD + POISON, bool)
        angles = 2 * np.pi * np.arange(SENSORS) / SENSORS
        self.directions = np.stack((np.cos(angles), np.sin(angles)))  # [2, S]
        self.across = np.stack((-np.sin(angles), np.cos(angles)))

    def reset(self) -> Numbers:
        """Pursuers at rest, everything anywhere outside the obstacle; returns [N, O]."""
        self.positions = np.stack([self.free_place(radius) for radius in self.radii])
        self.velocities = SPEED * self.rng.uniform(-0.5, 0.5, self.positions.shape)
        self.velocities[: self.agents] = 0
        self.contacts()
        return self.observe()

    def step(self, actions: Numbers) -> tuple[Numbers, Numbers, bool]:
        """Returns observations [N, O], rewards [N], and False: only time ends the game."""
        self.replace()
        self.velocities[: self.agents] += ACCELERATION * actions
        goal = self.positions + self.velocities
        self.positions = goal.clip(0, 1)
        hit = goal != self.positions
        hit_by_pursuer, hit_by_object = hit[: self.agents], hit[self.agents :]
        self.velocities[: self.agents][hit_by_pursuer] = 0
        self.velocities[self.agents :][hit_by_object] *= -1
        at_rim = ((self.positions - 0.5) ** 2).sum(1) <= (OBSTACLE + self.radii) ** 2
        self.velocities[at_rim] *= self.bounce[at_rim, None]
        return self.observe(), self.rewards(actions, *self.contacts()), False

    def replace(self) -> None:
        """Caught food and met poison come back elsewhere."""
        for thing in self.agents + np.flatnonzero(self.gone):
            self.positions[thing] = self.free_place(self.radii[thing])
            self.velocities[thing] = SPEED * self.rng.uniform(-0.5, 0.5, 2)

    def free_place(self, radius: float) -> Numbers:
        """Anywhere outside the obstacle, with room to spare."""
        while True:
            place = self.rng.random(2)
            if ((place - 0.5) ** 2).sum() >= (OBSTACLE + 2 * radius) ** 2:
                return place

    def contacts(self) -> tuple[Flags, Flags]:
        """Who touches what [N, food + poison], and which food is caught; remembers what is gone."""
        way = self.positions[self.agents :] - self.positions[: self.agents, None]
        touch = (way**2).sum(2) <= (RADII[0] + self.radii[self.agents :]) ** 2
        caught = touch[:, :FOOD].sum(0) >= self.catchers
        self.gone = np.concatenate((caught, touch[:, FOOD:].any(0)))
        return touch, caught

    def rewards(self, actions: Numbers, touch: Flags, caught: Flags) -> Numbers:
        """Each kind at most once for each pursuer: [N]."""
        rewards: Numbers = (
            CATCH * touch[:, :FOOD][:, caught].any(1)
            + TOUCH * touch[:, :FOOD].any(1)
            + POISONED * touch[:, FOOD:].any(1)
            + ACTION * (actions**2).sum(1)
        )
        return rewards

    def observe(self) -> Numbers:
        """Position; then of allies, food and poison each sensor's distance and velocity: [N, O]."""
        own = slice(0, self.agents)
        way = self.positions - self.positions[own, None]  # [N, objects, 2]
        along = way @ self.directions  # [N, objects, S]
        met = (along >= 0) & (along <= SENSOR_RANGE) & (abs(way @ self.across) <= RADII[0])
        met[range(self.agents), range(self.agents)] = False  # nobody senses itself
        distance = np.where(met, along, np.inf)
        speed = (self.velocities - self.velocities[own, None]) @ self.directions
        blocks = [2 * self.positions[own] - 1]
        for things in self.classes:
            nearest = distance[:, things].argmin(1, keepdims=True)  # [N, 1, S]
            read = np.take_along_axis(distance[:, things], nearest, 1)[:, 0]
            velocity = np.take_along_axis(speed[:, things], nearest, 1)[:, 0]
            seen = np.isfinite(read)
            blocks.append(np.where(seen, read / SENSOR_RANGE, 0))
            blocks.append(np.where(seen, velocity / VELOCITY_UNIT, 0))
        return np.concatenate(blocks, 1)
