"""The whole update against separate modules, loops over agents, autograd and torch's Adam."""

from copy import deepcopy
from typing import Any

import pytest
import torch
from torch import Tensor, nn

from msgdrop_cli.algorithms.maddpg import MADDPG, Config
from msgdrop_cli.networks.stacked import Stacked
from msgdrop_cli.ops.minibatch import Batch
from tests.maddpg_samples import (
    AGENTS,
    SIZE,
    make_batch,
    make_learner,
    mask_uniforms,
    small_config,
)
from tests.minibatches import in_memory

SENDERS = AGENTS - 1


class PlainCritic(nn.Module):
    """Q as the paper writes it, with `nn.Linear`."""

    def __init__(self, weights: Stacked, n: int, network: str) -> None:
        super().__init__()
        self.network = network
        self.layers = nn.ModuleList(_linear(layer, n) for layer in weights.views.values())

    def forward(self, own: Tensor, action: Tensor, others: Tensor) -> Tensor:
        """Inputs own [B, O], action [B, A], others [B, S*(O+A)]; returns [B]."""
        q: Tensor
        if self.network == "concat":
            q = torch.cat((own, action, others), -1)
            for layer in self.layers[:-1]:
                q = layer(q).relu()
            q = self.layers[-1](q)
            return q[:, 0]
        f1, f2, *g, h1, h2 = self.layers
        features = f2(torch.cat((f1(torch.cat((own, action), -1)).relu(), action), -1)).relu()
        if self.network == "fgh":
            features = torch.cat((features, g[0](others).relu()), -1)
        q = h2(h1(features).relu())
        return q[:, 0]


def _linear(layer: Any, n: int) -> nn.Linear:
    linear = nn.Linear(*layer.weight.shape[1:])
    linear.weight.data.copy_(layer.weight[n].T)
    linear.bias.data.copy_(layer.bias[n, 0])
    return linear


def _actor(weights: Stacked, n: int) -> nn.Sequential:
    first, second = (_linear(layer, n) for layer in weights.views.values())
    return nn.Sequential(first, nn.ReLU(), second, nn.Tanh())


class PlainRun:
    """One run, its agents one by one."""

    def __init__(self, learner: MADDPG, run: int, rate: float) -> None:
        self.config, self.rate, self.updates = learner.config, rate, 0
        shared = self.config.shares_parameters
        each = 1 if shared else AGENTS
        first, kind = run * each, self.config.network
        self.numbers = [first + n for n in range(each)]
        self.agents = [range(AGENTS) if shared else range(n, n + 1) for n in range(each)]
        self.network_of = [0 if shared else i for i in range(AGENTS)]
        halves = learner.actors, learner.critics
        self.actors = [_actor(halves[0].online, n) for n in self.numbers]
        self.target_actors = [_actor(halves[0].target, n) for n in self.numbers]
        self.critics = [PlainCritic(halves[1].online, n, kind) for n in self.numbers]
        self.target_critics = [PlainCritic(halves[1].target, n, kind) for n in self.numbers]
        self.adams = {
            id(m): torch.optim.Adam(m.parameters(), lr=self.config.learning_rate)
            for m in (*self.actors, *self.critics)
        }

    def others(self, i: int, obs: Tensor, action: Tensor, keep: Tensor) -> Tensor:
        """What the critic of agent i sees of the others: [B, S*(O+A)]."""
        senders = [j for j in range(AGENTS) if j != i]
        seen = [obs[:, j] * keep[i, :, k, None] for k, j in enumerate(senders)]
        masked = self.config.masks_actions
        acted = [
            action[:, j] * (keep[i, :, k, None] if masked else 1.0) for k, j in enumerate(senders)
        ]
        return torch.cat((*seen, *acted), -1)

    def target(self, i: int, batch: Batch, keep: Tensor) -> Tensor:
        """The target y of agent i (l. 273), [B]."""
        after = batch.obs[SIZE:]
        actors = [self.target_actors[n] for n in self.network_of]
        action = torch.stack([actor(after[:, j]) for j, actor in enumerate(actors)], 1)
        critic = self.target_critics[self.network_of[i]]
        value = critic(after[:, i], action[:, i], self.others(i, after, action, keep))
        y: Tensor = batch.reward[:, i] + self.config.gamma * batch.discount * value
        return y.detach()

    def update(self, batch: Batch, keep: Tensor) -> None:
        """Critics on their loss, then every second time the actors on theirs."""
        obs = batch.obs[:SIZE]
        seen = [self.others(i, obs, batch.action, keep) for i in range(AGENTS)]
        targets = [self.target(i, batch, keep) for i in range(AGENTS)]
        for agents, critic in zip(self.agents, self.critics, strict=True):
            errors = [critic(obs[:, i], batch.action[:, i], seen[i]) - targets[i] for i in agents]
            self._step(critic, torch.cat(errors).square().mean())
        self._follow(self.critics, self.target_critics)
        if self.updates % 2 == 0:
            for agents, actor, critic in zip(self.agents, self.actors, self.critics, strict=True):
                values = [critic(obs[:, i], actor(obs[:, i]), seen[i]) for i in agents]
                self._step(actor, -torch.cat(values).mean())
            self._follow(self.actors, self.target_actors)
        self.updates += 1

    def _step(self, module: nn.Module, loss: Tensor) -> None:
        for network in (*self.critics, module):
            network.zero_grad()
        loss.backward()
        if self.config.max_gradient_norm:
            nn.utils.clip_grad_norm_(module.parameters(), self.config.max_gradient_norm)
        self.adams[id(module)].step()

    def _follow(self, online: Any, target: Any) -> None:
        for one, other in zip(online, target, strict=True):
            for p, q in zip(one.parameters(), other.parameters(), strict=True):
                q.data += self.config.tau * (p.data - q.data)


def _check(weights: Stacked, numbers: list[int], modules: Any) -> None:
    for n, module in zip(numbers, modules, strict=True):
        linears = (part for part in module.modules() if isinstance(part, nn.Linear))
        for layer, linear in zip(weights.views.values(), linears, strict=True):
            torch.testing.assert_close(layer.weight[n], linear.weight.T, rtol=0, atol=2e-6)
            torch.testing.assert_close(layer.bias[n, 0], linear.bias, rtol=0, atol=2e-6)


@pytest.mark.parametrize("shared", [True, False], ids=["shared", "independent"])
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"masks_actions": True, "max_gradient_norm": 0.0},
        {"network": "concat"},
        {"network": "own", "max_gradient_norm": 0.05},
    ],
    ids=["maddpg-md", "masked-actions", "concat", "ddpg"],
)
def test_update_equals_separate_modules(changes: dict[str, Any], shared: bool) -> None:
    """Three updates of a cohort of two rates give what autograd gives agent by agent."""
    rates = (0.3, 0.7)
    config = {"shares_parameters": shared, "tau": 0.1, **changes}
    learner = make_learner(*[small_config(**config, rate=rate) for rate in rates])
    plain = [PlainRun(learner, run, rate) for run, rate in enumerate(rates)]
    for step in range(3):
        batch, uniforms = make_batch(2, seed=10 * step), mask_uniforms(learner, 2, step)
        learner.update(in_memory(batch), uniforms)
        for number, run in enumerate(plain):
            keep = torch.ones(AGENTS, SIZE, SENDERS)
            if learner.critic.senders:
                keep = (uniforms[number].view(keep.shape) >= run.rate).float()
            run.update(Batch(*(part[number] for part in batch if part is not None)), keep)
    for run in plain:
        _check(learner.critics.online, run.numbers, run.critics)
        _check(learner.critics.target, run.numbers, run.target_critics)
        _check(learner.actors.online, run.numbers, run.actors)
        _check(learner.actors.target, run.numbers, run.target_actors)


@pytest.mark.parametrize("shared", [True, False], ids=["shared", "independent"])
def test_policy_gradient_equals_autograd(shared: bool) -> None:
    """Itself, before Adam: within rounding of what autograd finds (l. 277)."""
    config = small_config(shares_parameters=shared, max_gradient_norm=0.0, rate=0.4)
    learner = make_learner(config)
    plain = PlainRun(learner, 0, 0.4)
    batch, uniforms = make_batch(), mask_uniforms(learner)
    learner.update(in_memory(batch), uniforms)
    keep = (uniforms.view(AGENTS, SIZE, SENDERS) >= 0.4).float()
    plain.update(Batch(*(part[0] for part in batch if part is not None)), keep)
    gradient = learner.actors.adam.moments["exp_avg"]  # a tenth of it, after the first step
    for n, actor in enumerate(plain.actors):
        linears = [part for part in actor if isinstance(part, nn.Linear)]
        for layer, linear in zip(gradient.views.values(), linears, strict=True):
            assert linear.weight.grad is not None
            assert linear.weight.grad.abs().max() > 1e-4
            expected = 0.1 * linear.weight.grad.T
            torch.testing.assert_close(layer.weight[n], expected, rtol=1e-4, atol=1e-8)


def test_actors_move_every_second_time_and_first_with_the_first() -> None:
    """Critic every 5, actor every 10 env steps (l. 772)."""
    learner = make_learner(small_config())
    moved = []
    for step in range(5):
        before = deepcopy(learner.actors.online.flat), deepcopy(learner.critics.online.flat)
        learner.update(in_memory(make_batch(seed=step)), mask_uniforms(learner, seed=step))
        now = learner.actors.online.flat, learner.critics.online.flat
        moved.append(tuple(not torch.equal(a, b) for a, b in zip(before, now, strict=True)))
    assert moved == [(True, True), (False, True), (True, True), (False, True), (True, True)]
    assert Config().actor_update_every_env_steps == 2 * Config().update_every_env_steps
