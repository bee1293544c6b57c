"""FDC, simple DCC and DCC-MD: double Q-learning with messages and message-dropout."""

import copy
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from benchmarks.plain.game import Array, Game
from benchmarks.plain.replay import Replay
from benchmarks.plain.stopwatch import Stopwatch

RATES = {"fdc": 0.0, "dcc": 0.0, "dcc-md": 0.2}
"""Name: probability of dropping a message in training. FDC's agents hear nobody."""
EPSILON = 0.22
"""Share of random actions: its mean over a run, 1 to 0.02 over the first 40%."""
REPLAY_CAPACITY = 200_000
GAMMA = 0.99
LEARNING_RATE = 1e-4
TARGET_UPDATE_EVERY_UPDATES = 1_000


class Units(NamedTuple):
    """Widths of the layers (paper l. 745-751, 757-762)."""

    f: tuple[int, int]
    g: int
    h: int = 32


class Batch(NamedTuple):
    """One agent's minibatch, float32: own [B, O], messages [B, S, O], the others [B]."""

    own: Tensor
    messages: Tensor
    action: Tensor
    reward: Tensor
    discount: Tensor
    next_own: Tensor
    next_messages: Tensor


class QNetwork(nn.Module):
    """Q = h(f(own), g(messages)); without senders h(f(own))."""

    def __init__(self, observation: int, senders: int, actions: int, units: Units) -> None:
        super().__init__()
        first, second = units.f
        self.f = nn.Sequential(
            nn.Linear(observation, first), nn.ReLU(), nn.Linear(first, second), nn.ReLU()
        )
        if senders:
            self.g = nn.Sequential(nn.Linear(senders * observation, units.g), nn.ReLU())
        joint = second + (units.g if senders else 0)
        self.h = nn.Sequential(nn.Linear(joint, units.h), nn.ReLU(), nn.Linear(units.h, actions))
        self.hears = senders > 0

    def forward(self, own: Tensor, messages: Tensor) -> Tensor:
        """own: [B, O]; messages: [B, S, O]; returns [B, A]."""
        joint = self.f(own)
        if self.hears:
            joint = torch.cat((joint, self.g(messages.flatten(1))), 1)
        q: Tensor = self.h(joint)
        return q


class Agent:
    """DDQN with message-dropout (paper l. 233-252) for one agent."""

    def __init__(self, network: QNetwork, rate: float) -> None:
        self.rate = rate
        self.online = network
        self.target = copy.deepcopy(network)
        self.optimizer = torch.optim.Adam(network.parameters(), lr=LEARNING_RATE)

    @torch.no_grad()
    def act(self, own: Tensor, messages: Tensor) -> int:
        """The greedy action on Q_exec; own: [1, O], messages: [1, S, O]."""
        return int(self.online(own, messages * (1 - self.rate)).argmax())

    def update(self, batch: Batch) -> None:
        """One step of Adam on the squared error; one keep mask for m and m'."""
        keep = (torch.rand(*batch.messages.shape[:2], 1) >= self.rate).float()  # [B, S, 1]
        with torch.no_grad():
            next_q_exec = self.online(batch.next_own, batch.next_messages * (1 - self.rate))
            next_q = self.target(batch.next_own, batch.next_messages * keep)
            value = next_q.gather(1, next_q_exec.argmax(1, keepdim=True)).squeeze(1)
            target = batch.reward + GAMMA * batch.discount * value
        q = self.online(batch.own, batch.messages * keep)
        loss = F.mse_loss(q.gather(1, batch.action[:, None]).squeeze(1), target)
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()


class QLearners:
    """One learner for each agent; they share the memory of joint transitions."""

    update_every_env_steps = 4

    def __init__(self, game: Game, algorithm: str, units: Units, rng: np.random.Generator) -> None:
        self.actions, self.rng = game.actions, rng
        self.replay = Replay(game, REPLAY_CAPACITY, rng)
        everybody = range(game.agents)
        self.senders = [[j for j in everybody if j != i and algorithm != "fdc"] for i in everybody]
        self.agents = [
            Agent(QNetwork(game.observation, len(senders), game.actions, units), RATES[algorithm])
            for senders in self.senders
        ]
        self.updates = 0

    def act(self, obs: Array) -> list[int]:
        """Epsilon-greedy actions of all agents."""
        explores = self.rng.random(len(self.agents)) < EPSILON
        actions: list[int] = self.rng.integers(self.actions, size=len(self.agents)).tolist()
        seen = torch.from_numpy(obs).float()  # [N, O]
        for i, agent in enumerate(self.agents):
            if not explores[i]:
                actions[i] = agent.act(seen[None, i], seen[None, self.senders[i]])
        return actions

    def update(self, watch: Stopwatch) -> None:
        """Every agent learns from a minibatch of its own."""
        for i, agent in enumerate(self.agents):
            batch = self.sample(i)
            watch.lap("sample")
            agent.update(batch)
            watch.lap("update")
        self.updates += 1
        if self.updates % TARGET_UPDATE_EVERY_UPDATES == 0:
            for agent in self.agents:
                agent.target.load_state_dict(agent.online.state_dict())

    def sample(self, agent: int) -> Batch:
        """A minibatch as one agent sees it."""
        memory, rows = self.replay, self.replay.draw()
        shown = rows[:, None], [agent, *self.senders[agent]]
        obs = torch.from_numpy(memory.obs[shown]).float()  # [B, 1 + S, O]
        next_obs = torch.from_numpy(memory.next_obs[shown]).float()
        return Batch(
            own=obs[:, 0],
            messages=obs[:, 1:],
            action=torch.from_numpy(memory.actions[rows, agent]),
            reward=torch.from_numpy(memory.rewards[rows, agent]),
            discount=torch.from_numpy(memory.discount[rows]),
            next_own=next_obs[:, 0],
            next_messages=next_obs[:, 1:],
        )
