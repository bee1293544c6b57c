"""Cooperative navigation: the rules are those of `msgdrop_envs.navigation`, written once more."""

import numpy as np
import numpy.typing as npt

PUSHES = 5.0 * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
DT, DAMPING = 0.1, 0.25
CONTACT_FORCE, CONTACT_MARGIN, CONTACT = 100.0, 1e-3, 0.3
SIGHT = 0.5
COLLISION_PENALTY = 2.0

Numbers = npt.NDArray[np.float64]


class Navigation:
    """One game with as many landmarks as agents."""

    dtype = np.float32
    actions = len(PUSHES)
    action_size = 0
    time_limit = 25

    def __init__(self, agents: int, rng: np.random.Generator) -> None:
        self.agents = agents
        self.observation = 4 + 2 * agents + 2 * (agents - 1)
        self.rng = rng
        self.positions = self.velocities = self.landmarks = np.zeros((agents, 2))
        self.oneself = np.eye(agents, dtype=bool)

    def reset(self) -> Numbers:
        """Agents at rest and landmarks anywhere; returns the observations [N, O]."""
        self.positions, self.landmarks = self.rng.uniform(-1, 1, (2, self.agents, 2))
        self.velocities = np.zeros((self.agents, 2))
        return self.observe(*self.to_others())

    def step(self, actions: list[int]) -> tuple[Numbers, Numbers, bool]:
        """Returns observations [N, O], rewards [N], and False: only time ends the game."""
        force = PUSHES[actions] + self.contact_force(*self.to_others())
        self.velocities = (1 - DAMPING) * self.velocities + DT * force
        self.positions = self.positions + DT * self.velocities
        way, apart = self.to_others()
        to_landmarks = self.positions[:, None] - self.landmarks
        nearest = np.sqrt((to_landmarks**2).sum(2).min(1))
        rewards = -nearest - COLLISION_PENALTY * (apart < CONTACT).sum(1)
        return self.observe(way, apart), rewards, False

    def to_others(self) -> tuple[Numbers, Numbers]:
        """From each agent to each: the way [N, N, 2] and the distance [N, N], to itself inf."""
        way = self.positions - self.positions[:, None]
        apart = np.sqrt((way**2).sum(2))
        apart[self.oneself] = np.inf
        return way, apart

    def contact_force(self, way: Numbers, apart: Numbers) -> Numbers:
        """What the others push each agent with: [N, 2]."""
        depth = CONTACT_MARGIN * np.logaddexp(0, (CONTACT - apart) / CONTACT_MARGIN)
        force: Numbers = -CONTACT_FORCE * (way * (depth / apart)[..., None]).sum(1)
        return force

    def observe(self, way: Numbers, apart: Numbers) -> Numbers:
        """Velocity, position, landmarks, others that are near: [N, 4 + 2N + 2(N-1)]."""
        landmarks = self.landmarks - self.positions[:, None]
        others = np.where((apart < SIGHT)[..., None], way, 0)[~self.oneself]
        blocks = (
            self.velocities,
            self.positions,
            landmarks.reshape(self.agents, -1),
            others.reshape(self.agents, -1),
        )
        return np.concatenate(blocks, 1)
