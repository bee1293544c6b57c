"""DDPG, vanilla MADDPG, MADDPG and MADDPG-MD: deterministic actors, critics that see more.

All agents share one actor and one critic (paper l. 772); as in OpenAI's code of MADDPG, acting and
both losses go agent by agent.
"""

import copy
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from benchmarks.plain.game import Array, Game
from benchmarks.plain.replay import Replay
from benchmarks.plain.stopwatch import Stopwatch

RATES = {"ddpg": 0.0, "vanilla-maddpg": 0.0, "maddpg": 0.0, "maddpg-md": 0.2}
"""Name: probability of dropping another agent's observation in training."""
REPLAY_CAPACITY = 500_000
GAMMA = 0.95
LEARNING_RATE = 1e-3
TAU = 0.01
NOISE = 0.15
MAX_GRADIENT_NORM = 0.5
ACTOR_UPDATE_EVERY_UPDATES = 2


class Batch(NamedTuple):
    """Joint transitions, float32: obs [B, N, O], action [B, N, A], reward [B, N], discount [B]."""

    obs: Tensor
    action: Tensor
    reward: Tensor
    discount: Tensor
    next_obs: Tensor


class Critic(nn.Module):
    """Q = h(f(o, a), g(the others)), the action entering f twice (l. 770); DDPG's has no g."""

    def __init__(self, observation: int, action: int, senders: int) -> None:
        super().__init__()
        self.f1 = nn.Linear(observation + action, 200)
        self.f2 = nn.Linear(200 + action, 100)
        if senders:
            self.g = nn.Linear(senders * (observation + action), 100)
        self.h = nn.Sequential(nn.Linear(200 if senders else 100, 64), nn.ReLU(), nn.Linear(64, 1))
        self.hears = senders > 0

    def forward(self, own: Tensor, action: Tensor, others: Tensor) -> Tensor:
        """own: [B, O]; action: [B, A]; others: [B, S * (O + A)]; returns [B]."""
        f1 = self.f1(torch.cat((own, action), 1)).relu()
        joint = self.f2(torch.cat((f1, action), 1))
        if self.hears:
            joint = torch.cat((joint, self.g(others)), 1)
        q: Tensor = self.h(joint.relu()).squeeze(1)
        return q


class VanillaCritic(nn.Module):
    """One perceptron on everything."""

    def __init__(self, observation: int, action: int, senders: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear((1 + senders) * (observation + action), 200),
            nn.ReLU(),
            nn.Linear(200, 100),
            nn.ReLU(),
            nn.Linear(100, 64),
            nn.ReLU(),
            nn.Linear(64, 1),
        )

    def forward(self, own: Tensor, action: Tensor, others: Tensor) -> Tensor:
        """As `Critic`."""
        q: Tensor = self.layers(torch.cat((own, action, others), 1)).squeeze(1)
        return q


class MADDPG:
    """The actor, the critic, their targets, and how they learn."""

    update_every_env_steps = 5

    def __init__(self, game: Game, algorithm: str, rng: np.random.Generator) -> None:
        self.rate, self.rng = RATES[algorithm], rng
        self.replay = Replay(game, REPLAY_CAPACITY, rng)
        self.agents = range(game.agents)
        self.senders = [
            [j for j in self.agents if j != i and algorithm != "ddpg"] for i in self.agents
        ]
        observation, action = game.observation, game.action_size
        self.actor = nn.Sequential(
            nn.Linear(observation, 64), nn.ReLU(), nn.Linear(64, action), nn.Tanh()
        )
        critic = VanillaCritic if algorithm == "vanilla-maddpg" else Critic
        self.critic: nn.Module = critic(observation, action, len(self.senders[0]))
        self.actor_target = copy.deepcopy(self.actor)
        self.critic_target = copy.deepcopy(self.critic)
        self.actor_optimizer = torch.optim.Adam(self.actor.parameters(), lr=LEARNING_RATE)
        self.critic_optimizer = torch.optim.Adam(self.critic.parameters(), lr=LEARNING_RATE)
        self.updates = 0

    @torch.no_grad()
    def act(self, obs: Array) -> npt.NDArray[np.float64]:
        """Every agent's action with Gaussian noise: [N, A]."""
        seen = torch.from_numpy(obs).float()
        actions = np.stack([self.actor(seen[i]).numpy() for i in self.agents])
        noise = NOISE * self.rng.standard_normal(actions.shape)
        clipped: npt.NDArray[np.float64] = (actions + noise).clip(-1, 1)
        return clipped

    def update(self, watch: Stopwatch) -> None:
        """The critic learns, and every second time the actor, with the same minibatch and mask."""
        batch = self.sample()
        watch.lap("sample")
        size, agents = batch.reward.shape
        keep = (torch.rand(agents, size, len(self.senders[0]), 1) >= self.rate).float()
        others = [self.others(i, batch.obs, batch.action, keep[i]) for i in self.agents]
        loss = self.critic_loss(batch, others, keep)
        self.step(loss, self.critic, self.critic_target, self.critic_optimizer)
        if self.updates % ACTOR_UPDATE_EVERY_UPDATES == 0:
            loss = self.actor_loss(batch, others)
            self.step(loss, self.actor, self.actor_target, self.actor_optimizer)
        self.updates += 1
        watch.lap("update")

    def critic_loss(self, batch: Batch, others: list[Tensor], keep: Tensor) -> Tensor:
        """The mean of the agents' squared errors."""
        losses = []
        with torch.no_grad():
            next_actions = [self.actor_target(batch.next_obs[:, i]) for i in self.agents]
            next_action = torch.stack(next_actions, 1)  # [B, N, A]
        for i in self.agents:
            with torch.no_grad():
                next_others = self.others(i, batch.next_obs, next_action, keep[i])
                next_q = self.critic_target(batch.next_obs[:, i], next_action[:, i], next_others)
                target = batch.reward[:, i] + GAMMA * batch.discount * next_q
            q = self.critic(batch.obs[:, i], batch.action[:, i], others[i])
            losses.append(F.mse_loss(q, target))
        return torch.stack(losses).mean()

    def actor_loss(self, batch: Batch, others: list[Tensor]) -> Tensor:
        """Minus the mean value of the actor's own actions, the others' as they were."""
        values = [
            self.critic(batch.obs[:, i], self.actor(batch.obs[:, i]), others[i]).mean()
            for i in self.agents
        ]
        return -torch.stack(values).mean()

    def others(self, agent: int, obs: Tensor, action: Tensor, keep: Tensor) -> Tensor:
        """What the critic is shown of the others, their observations masked: [B, S * (O + A)]."""
        senders = self.senders[agent]
        seen = (obs[:, senders] * keep).flatten(1)
        return torch.cat((seen, action[:, senders].flatten(1)), 1)

    def step(
        self, loss: Tensor, network: nn.Module, target: nn.Module, optimizer: torch.optim.Optimizer
    ) -> None:
        """Move one network down its loss and let its target follow."""
        parameters = list(network.parameters())
        optimizer.zero_grad()
        loss.backward(inputs=parameters)
        nn.utils.clip_grad_norm_(parameters, MAX_GRADIENT_NORM)
        optimizer.step()
        with torch.no_grad():
            for follower, leader in zip(target.parameters(), parameters, strict=True):
                follower.lerp_(leader, TAU)

    def sample(self) -> Batch:
        """One minibatch for all agents."""
        memory, rows = self.replay, self.replay.draw()
        return Batch(
            obs=torch.from_numpy(memory.obs[rows]),
            action=torch.from_numpy(memory.actions[rows]),
            reward=torch.from_numpy(memory.rewards[rows]),
            discount=torch.from_numpy(memory.discount[rows]),
            next_obs=torch.from_numpy(memory.next_obs[rows]),
        )
