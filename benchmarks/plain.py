"""The straightforward implementation: DCC-MD on pursuit as a good researcher would write it.

One game in Python and numpy, one `nn.Module` and one Adam per agent, replay in numpy, autograd,
one thread. It is what `throughput.py` compares the engine with, and shares no code with it. It
takes the shortcuts that cost nothing in clarity (observations kept as bytes, one conversion to a
tensor per minibatch, no forward pass for a random action) and none that do.
"""

import copy
import json
import sys
import time
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
import torch.nn.functional as F
from torch import Tensor, nn

CASES = {"pursuit-n6": (6, 15), "pursuit-n8": (8, 17)}
"""Name: pursuers and map size (paper l. 373)."""
RATE = 0.2
"""Probability of dropping a message in training."""
EPSILON = 0.22
"""Share of random actions: the mean over 5e6 env steps, 1 to 0.02 over the first 2e6."""
REPLAY_CAPACITY = 200_000
REPLAY_START = 10_000
BATCH = 32
GAMMA = 0.99
LEARNING_RATE = 1e-4
UPDATE_EVERY_ENV_STEPS = 4
TARGET_UPDATE_EVERY_UPDATES = 1_000
TIME_LIMIT = 500

MOVES = ((-1, 0), (0, 1), (0, -1), (1, 0), (0, 0))
SIGHT = 3
WINDOW = 2 * SIGHT + 1
OBSERVATION = 3 * WINDOW**2

Cell = tuple[int, int]
Obs = npt.NDArray[np.uint8]


class Pursuit:
    """One game; the rules are those of `msgdrop_envs.pursuit`, written once more."""

    def __init__(self, agents: int, size: int, rng: np.random.Generator) -> None:
        self.agents = agents
        self.size = size
        self.rng = rng
        self.pursuers: list[Cell] = []
        self.evaders: list[Cell] = []
        padded = size + 2 * SIGHT
        self.grid = np.zeros((3, padded, padded), np.uint8)  # pursuers, evaders, off the map
        self.grid[2] = 1
        self.grid[2, SIGHT:-SIGHT, SIGHT:-SIGHT] = 0
        # A view: what is written to the grid is seen in the windows. [3, size, size, 7, 7]
        self.windows = np.lib.stride_tricks.sliding_window_view(self.grid, (WINDOW, WINDOW), (1, 2))

    def reset(self) -> Obs:
        """Pursuers anywhere, both evaders at the centre; returns the observations [N, O]."""
        cells = self.rng.integers(self.size, size=(self.agents, 2)).tolist()
        self.pursuers = [(row, column) for row, column in cells]
        self.evaders = [(self.size // 2, self.size // 2)] * 2
        return self.observe()

    def step(self, actions: list[int]) -> tuple[Obs, list[float], bool]:
        """Returns observations [N, O], rewards [N], and whether both evaders are captured."""
        rewards = [-0.05] * self.agents
        for i, action in enumerate(actions):
            goal = self.neighbour(self.pursuers[i], action)
            if self.on_map(goal):
                self.pursuers[i] = goal
            else:
                rewards[i] -= 0.5
        taken = set(self.pursuers)
        escaped = []
        for evader, move in zip(self.evaders, self.rng.integers(5, size=2).tolist(), strict=False):
            goal = self.neighbour(evader, move)
            cell = goal if self.on_map(goal) and goal not in taken else evader
            sides = [self.neighbour(cell, side) for side in range(4)]
            if all(side in taken or not self.on_map(side) for side in sides):
                for i, pursuer in enumerate(self.pursuers):
                    rewards[i] += 5.0 * (pursuer in sides)
            else:
                escaped.append(cell)
        self.evaders = escaped
        return self.observe(), rewards, not escaped

    def observe(self) -> Obs:
        """Other pursuers, evaders, off the map, each 7 x 7 around the agent: [N, 147]."""
        self.grid[:2] = 0
        for row, column in self.pursuers:
            self.grid[0, row + SIGHT, column + SIGHT] += 1
        for row, column in self.evaders:
            self.grid[1, row + SIGHT, column + SIGHT] += 1
        rows, columns = zip(*self.pursuers, strict=True)
        obs = self.windows[:, rows, columns].swapaxes(0, 1).reshape(self.agents, OBSERVATION)
        obs[:, WINDOW**2 // 2] -= 1  # not oneself
        return obs

    def on_map(self, cell: Cell) -> bool:
        """Whether the cell is one of the map's."""
        return 0 <= cell[0] < self.size and 0 <= cell[1] < self.size

    @staticmethod
    def neighbour(cell: Cell, move: int) -> Cell:
        """The cell that a move leads to, on the map or not."""
        return cell[0] + MOVES[move][0], cell[1] + MOVES[move][1]


class Batch(NamedTuple):
    """One agent's minibatch, float32: own [B, O], messages [B, N-1, O], the others [B]."""

    own: Tensor
    messages: Tensor
    action: Tensor
    reward: Tensor
    discount: Tensor
    next_own: Tensor
    next_messages: Tensor


class Replay:
    """The joint transitions of all agents in a ring; each agent draws rows of its own."""

    def __init__(self, agents: int, rng: np.random.Generator) -> None:
        self.rng = rng
        self.obs = np.empty((REPLAY_CAPACITY, agents, OBSERVATION), np.uint8)
        self.next_obs = np.empty_like(self.obs)
        self.actions = np.empty((REPLAY_CAPACITY, agents), np.int64)
        self.rewards = np.empty((REPLAY_CAPACITY, agents), np.float32)
        self.discount = np.empty(REPLAY_CAPACITY, np.float32)
        self.others = [[j for j in range(agents) if j != i] for i in range(agents)]
        self.added = 0

    def add(
        self, obs: Obs, actions: list[int], rewards: list[float], next_obs: Obs, discount: float
    ) -> None:
        """Store one joint transition over the oldest one."""
        row = self.added % REPLAY_CAPACITY
        self.obs[row] = obs
        self.next_obs[row] = next_obs
        self.actions[row] = actions
        self.rewards[row] = rewards
        self.discount[row] = discount
        self.added += 1

    def sample(self, agent: int) -> Batch:
        """A minibatch as one agent sees it."""
        rows = self.rng.integers(min(self.added, REPLAY_CAPACITY), size=BATCH)
        obs = torch.from_numpy(self.obs[rows]).float()  # [B, N, O]
        next_obs = torch.from_numpy(self.next_obs[rows]).float()  # [B, N, O]
        return Batch(
            own=obs[:, agent],
            messages=obs[:, self.others[agent]],
            action=torch.from_numpy(self.actions[rows, agent]),
            reward=torch.from_numpy(self.rewards[rows, agent]),
            discount=torch.from_numpy(self.discount[rows]),
            next_own=next_obs[:, agent],
            next_messages=next_obs[:, self.others[agent]],
        )


class QNetwork(nn.Module):
    """Q = h(f(own), g(messages)) with the sizes of the paper (l. 745-751)."""

    def __init__(self, agents: int) -> None:
        super().__init__()
        units = 16 * agents  # 96 for N=6, 128 for N=8
        self.f = nn.Sequential(nn.Linear(OBSERVATION, 64), nn.ReLU(), nn.Linear(64, 48), nn.ReLU())
        self.g = nn.Sequential(nn.Linear((agents - 1) * OBSERVATION, units), nn.ReLU())
        self.h = nn.Sequential(nn.Linear(48 + units, 32), nn.ReLU(), nn.Linear(32, len(MOVES)))

    def forward(self, own: Tensor, messages: Tensor) -> Tensor:
        """own: [B, O]; messages: [B, N-1, O]; returns [B, A]."""
        q: Tensor = self.h(torch.cat((self.f(own), self.g(messages.flatten(1))), 1))
        return q


class Agent:
    """DDQN with message-dropout (paper l. 233-252) for one agent."""

    def __init__(self, agents: int) -> None:
        self.online = QNetwork(agents)
        self.target = copy.deepcopy(self.online)
        self.optimizer = torch.optim.Adam(self.online.parameters(), lr=LEARNING_RATE)

    @torch.no_grad()
    def act(self, own: Tensor, messages: Tensor) -> int:
        """The greedy action on Q_exec; own: [1, O], messages: [1, N-1, O]."""
        return int(self.online(own, messages * (1 - RATE)).argmax())

    def update(self, batch: Batch) -> None:
        """One step of Adam on the squared error; one keep mask for m and m'."""
        keep = (torch.rand(*batch.messages.shape[:2], 1) >= RATE).float()  # [B, N-1, 1]
        with torch.no_grad():
            next_q_exec = self.online(batch.next_own, batch.next_messages * (1 - RATE))
            next_q = self.target(batch.next_own, batch.next_messages * keep)
            value = next_q.gather(1, next_q_exec.argmax(1, keepdim=True)).squeeze(1)
            target = batch.reward + GAMMA * batch.discount * value
        q = self.online(batch.own, batch.messages * keep)
        loss = F.mse_loss(q.gather(1, batch.action[:, None]).squeeze(1), target)
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()


class Training:
    """The loop: act, step and store, and every fourth step sample and update."""

    def __init__(self, agents: int, size: int, seed: int) -> None:
        torch.manual_seed(seed)
        self.rng = np.random.default_rng(seed)
        self.game = Pursuit(agents, size, self.rng)
        self.replay = Replay(agents, self.rng)
        self.agents = [Agent(agents) for _ in range(agents)]
        self.obs = self.game.reset()
        self.episode_steps = self.env_steps = self.updates = 0
        self.seconds = dict.fromkeys(("act", "step", "sample", "update"), 0.0)
        self.clock = time.perf_counter()

    def env_step(self, epsilon: float) -> None:
        """One step of the game, and the update if it is due."""
        self.clock = time.perf_counter()
        actions = self.act(epsilon)
        self.spent("act")
        next_obs, rewards, finished = self.game.step(actions)
        self.replay.add(self.obs, actions, rewards, next_obs, 0.0 if finished else 1.0)
        self.env_steps += 1
        self.episode_steps += 1
        if finished or self.episode_steps == TIME_LIMIT:
            next_obs, self.episode_steps = self.game.reset(), 0
        self.obs = next_obs
        self.spent("step")
        if self.replay.added > REPLAY_START and self.env_steps % UPDATE_EVERY_ENV_STEPS == 0:
            self.update()

    def act(self, epsilon: float) -> list[int]:
        """Epsilon-greedy actions of all agents."""
        explores = self.rng.random(len(self.agents)) < epsilon
        actions: list[int] = self.rng.integers(len(MOVES), size=len(self.agents)).tolist()
        obs = torch.from_numpy(self.obs).float()  # [N, O]
        for i, agent in enumerate(self.agents):
            if not explores[i]:
                actions[i] = agent.act(obs[None, i], obs[None, self.replay.others[i]])
        return actions

    def update(self) -> None:
        """Every agent learns from a minibatch of its own."""
        for i, agent in enumerate(self.agents):
            batch = self.replay.sample(i)
            self.spent("sample")
            agent.update(batch)
            self.spent("update")
        self.updates += 1
        if self.updates % TARGET_UPDATE_EVERY_UPDATES == 0:
            for agent in self.agents:
                agent.target.load_state_dict(agent.online.state_dict())

    def spent(self, part: str) -> None:
        """Add the time since the last call to a part."""
        now = time.perf_counter()
        self.seconds[part] += now - self.clock
        self.clock = now


def measure(env_name: str, seconds: float) -> dict[str, float]:
    """Train for `seconds` on one thread and say where the time went.

    Returns env_steps_per_s, and act, step, sample, update in ms per env step (an update's cost is
    spread over the 4 env steps it serves). The replay is filled and the code warm before the
    clock starts.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        training = Training(*CASES[env_name], seed=1)
        for _ in range(REPLAY_START):
            training.env_step(epsilon=1.0)
        for _ in range(25 * UPDATE_EVERY_ENV_STEPS):
            training.env_step(EPSILON)
        training.seconds = dict.fromkeys(training.seconds, 0.0)
        first, start = training.env_steps, time.perf_counter()
        while time.perf_counter() - start < seconds:
            for _ in range(UPDATE_EVERY_ENV_STEPS):
                training.env_step(EPSILON)
        wall = time.perf_counter() - start
    finally:
        torch.set_num_threads(threads)
    steps = training.env_steps - first
    parts = {part: round(1e3 * spent / steps, 4) for part, spent in training.seconds.items()}
    return {"env_steps_per_s": round(steps / wall, 1), **parts}


if __name__ == "__main__":
    for name in sys.argv[1:] or CASES:
        print(json.dumps({"environment": name, **measure(name, seconds=10.0)}))
