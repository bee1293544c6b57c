"""The whole update against separate modules, autograd and torch's Adam."""

from typing import Any

import pytest
import torch
from torch import nn
from torch.nn import functional

from tests.dcc_samples import (
    AGENTS,
    KERNELS,
    OBSERVATION,
    make_batch,
    make_learner,
    mask_uniforms,
    small_config,
    use_kernel,
)
from tests.minibatches import in_memory
from tests.separate_networks import linears, separate


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"dropout": "element", "drops_own": True},
        {"network": "concat", "loss": "huber"},
        {"network": "own", "max_gradient_norm": 0.05},
    ],
    ids=["dcc-md", "full-sd", "concat-huber", "fdc-clipped"],
)
def test_update_equals_separate_modules_and_torchs_adam(
    changes: dict[str, Any], kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three updates of a cohort of two rates give what six separate agents get, within 1e-6."""
    use_kernel(kernel, monkeypatch)
    rates = (0.2, 0.6)
    learner = make_learner(*[small_config(**changes, rate=r, learning_rate=1e-3) for r in rates])
    agents = [separate(learner.network, learner.online, n) for n in range(2 * AGENTS)]
    targets = [separate(learner.network, learner.target, n) for n in range(2 * AGENTS)]
    optimisers = [torch.optim.Adam(agent.parameters(), lr=1e-3) for agent in agents]
    own, shown = learner.config.drops_own, learner.shown_agents.shape[1]
    width = OBSERVATION if learner.config.dropout == "element" else 1
    for step in range(3):
        batch, uniforms = make_batch(learner, step), mask_uniforms(learner, 2, step)
        learner.update(in_memory(batch), uniforms)
        units = uniforms.view(2 * AGENTS, 5, shown if own else shown - 1, width)
        for n, (agent, target) in enumerate(zip(agents, targets, strict=True)):
            rate, obs = rates[n // AGENTS], batch.obs[n].float()
            keep, scale = torch.ones(5, shown, width), torch.full((shown, 1), 1 - rate)
            keep[:, 0 if own else 1 :] = (units[n] >= rate).float()
            scale[: 0 if own else 1] = 1.0
            with torch.no_grad():
                best = agent((obs[5:] * scale).flatten(1)).argmax(-1, keepdim=True)
                value = target((obs[5:] * keep).flatten(1)).gather(-1, best)[:, 0]
                y = batch.reward[n] + 0.99 * batch.discount[n] * value
            q = agent((obs[:5] * keep).flatten(1)).gather(-1, batch.action[n][:, None])[:, 0]
            loss = functional.mse_loss if learner.config.loss == "mse" else functional.huber_loss
            optimisers[n].zero_grad()
            loss(q, y).backward()
            if learner.config.max_gradient_norm:
                nn.utils.clip_grad_norm_(agent.parameters(), learner.config.max_gradient_norm)
            optimisers[n].step()
    for n, agent in enumerate(agents):
        for layer, linear in zip(learner.online.views.values(), linears(agent), strict=True):
            torch.testing.assert_close(layer.weight[n], linear.weight.T, rtol=0, atol=1e-6)
            torch.testing.assert_close(layer.bias[n, 0], linear.bias, rtol=0, atol=1e-6)
