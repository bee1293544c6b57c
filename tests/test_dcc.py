"""The learner does what the paper's equations say, and its names mean what the paper means."""

from typing import Any

import numpy as np
import pytest
import torch

from msgdrop_cli.algorithms.dcc import DCC, NAMED, Config
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.messages.received import Received
from msgdrop_envs import registry
from tests.dcc_samples import (
    AGENTS,
    KERNELS,
    OBSERVATION,
    Array,
    first_gradient,
    integers,
    make_batch,
    make_learner,
    mask_uniforms,
    rand,
    small_config,
    use_kernel,
    weights_of,
)
from tests.minibatches import in_memory


def _q(weights: dict[str, Array], own: Array, messages: Array, message_scale: float = 1) -> Array:
    """Q = h(f(o), g(m)) in numpy, g's outgoing weights of m multiplied as the paper says."""

    def layer(name: str, inputs: Array, scale: float = 1) -> Array:
        result: Array = inputs @ (weights[f"{name}.weight"] * scale) + weights[f"{name}.bias"]
        return result

    def relu(values: Array) -> Array:
        return np.maximum(values, 0.0)

    f = relu(layer("f2", relu(layer("f1", own))))
    g = relu(layer("g1", messages, message_scale))
    return layer("h2", relu(layer("h1", np.concatenate([f, g], -1))))


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("rate", [0.0, 0.3, 0.8, 1.0])
def test_target_is_the_papers_equation(
    rate: float, kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The TD errors are those of l. 244 and 247, computed in numpy on the same weights and batch.

    Every action occurs once in the batch, so h's last bias has the gradient 2 / B * (Q - y) of
    one sample in each place.
    """
    use_kernel(kernel, monkeypatch)
    learner = make_learner(small_config(rate=rate, gamma=0.9))
    batch, uniforms = make_batch(learner), mask_uniforms(learner)
    online = [weights_of(learner, "online", i) for i in range(AGENTS)]
    target = [weights_of(learner, "target", i) for i in range(AGENTS)]
    learner.update(in_memory(batch), uniforms)
    obs, reward = batch.obs.double().numpy(), batch.reward.double().numpy()
    b = (uniforms.double().numpy() >= np.float32(rate)).reshape(AGENTS, 5, 2, 1)  # 0: dropped
    for i in range(AGENTS):
        own, messages = obs[i, :, 0], obs[i, :, 1:]
        masked = (messages[:5] * b[i]).reshape(5, -1)
        masked_next = (messages[5:] * b[i]).reshape(5, -1)
        q_exec = _q(online[i], own[5:], messages[5:].reshape(5, -1), 1 - rate)
        values = _q(target[i], own[5:], masked_next)
        best = values[np.arange(5), q_exec.argmax(-1)]
        y = reward[i] + 0.9 * batch.discount[i].double().numpy() * best
        error = _q(online[i], own[:5], masked)[np.arange(5), np.arange(5)] - y
        found = first_gradient(learner, "h2")[i].numpy()
        np.testing.assert_allclose(found, 2 / 5 * error, rtol=1e-4, atol=1e-5)


def test_policy_reads_the_senders_in_increasing_order() -> None:
    """Q_exec of agent i is of (o^i, m^i) with m^i in increasing order, skipping i (l. 149, 248)."""
    learner = make_learner(small_config(rate=0.3))
    obs = integers(3, 1, 4, AGENTS, OBSERVATION, seed=3)
    keep = integers(2, 1, 4, AGENTS, AGENTS - 1, seed=4).float()
    q, q_broken = learner.q_exec(obs), learner.q_exec(obs, Received(keep))
    seen, links = obs[0].double().numpy(), keep[0].double().numpy()
    for i, senders in enumerate([[1, 2], [0, 2], [0, 1]]):
        weights, m = weights_of(learner, "online", i), seen[:, senders]
        expected = _q(weights, seen[:, i], m.reshape(4, -1), 0.7)
        np.testing.assert_allclose(q[0, :, i].numpy(), expected, rtol=1e-4, atol=1e-5)
        expected = _q(weights, seen[:, i], (m * links[:, i, :, None]).reshape(4, -1), 0.7)
        np.testing.assert_allclose(q_broken[0, :, i].numpy(), expected, rtol=1e-4, atol=1e-5)
    assert torch.equal(learner.act_greedily(obs, Received(keep)), q_broken.argmax(-1))


@pytest.mark.parametrize("network", ["fgh", "concat"])
def test_scaling_inputs_is_scaling_weights(network: str) -> None:
    """Q_exec equals Q with the messages' outgoing weights times 1 - rate, the bias untouched."""
    scaled, plain = (make_learner(small_config(rate=r, network=network)) for r in (0.3, 0.0))
    layer = plain.online["g1" if network == "fgh" else "layer1"]
    first = 0 if network == "fgh" else OBSERVATION
    layer.weight[:, first:] *= 0.7
    obs = integers(3, 1, 6, AGENTS, OBSERVATION, seed=3)
    torch.testing.assert_close(scaled.q_exec(obs), plain.q_exec(obs), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "environment", "expected"),
    [
        *((name, "pursuit-n6", 88_053) for name in ("dcc", "dcc-md", "dcc-sd", "full-md")),
        *((name, "pursuit-n8", 150_261) for name in ("dcc", "dcc-md", "full-sd")),
        *(("fdc", environment, 14_325) for environment in ("pursuit-n6", "pursuit-n8")),
        ("concat-md", "pursuit-n6", 61_365),
        ("concat-dcc", "pursuit-n8", 80_181),
        *((name, "navigation-n8", 25_989) for name in ("dcc", "dcc-md")),
        *((name, "navigation-n10", 35_461) for name in ("dcc", "dcc-md")),
        ("fdc", "navigation-n8", 8_645),
    ],
)
def test_named_algorithms_have_the_papers_sizes(name: str, environment: str, expected: int) -> None:
    """Parameters per agent with the paper's settings (figure 8, l. 745-751, 757-761)."""
    sizes = catalogue().sizes(environment, "dcc").algorithm
    config = Config(**{**sizes, **NAMED[name]})
    env = registry.make(environment)
    learner = DCC([config], env)
    assert learner.init_uniforms == env.agents * expected
    assert sum(view[0].numel() for view in learner.policy(0).values()) == expected


def test_target_network_is_copied_every_period_of_updates() -> None:
    """Alike at first; then it stands still, and is the online network after every third update."""
    learner = make_learner(small_config(target_update_every_updates=3))
    learner.initialise(rand(1, learner.init_uniforms, seed=1))
    assert torch.equal(learner.target.flat, learner.online.flat)
    last = learner.online.flat.clone()
    for update in range(1, 8):
        learner.update(in_memory(make_batch(learner, update)), mask_uniforms(learner, seed=update))
        last = learner.online.flat.clone() if update % 3 == 0 else last
        assert torch.equal(learner.target.flat, last)
        assert torch.equal(learner.target.flat, learner.online.flat) == (update % 3 == 0)


@pytest.mark.parametrize("kernel", KERNELS)
def test_metrics_are_means_since_the_last_call(
    kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Loss is None before any update, then the mean of each run's losses, then None again."""
    use_kernel(kernel, monkeypatch)
    learner = make_learner(small_config(), small_config(rate=0.7))
    assert [row["loss"] for row in learner.metrics(0)] == [None, None]
    losses = []
    for step in range(2):
        for moment in learner.adam.moments.values():
            moment.flat.zero_()
        learner.update(in_memory(make_batch(learner, step)), mask_uniforms(learner, 2, step))
        per_network = first_gradient(learner, "h2")  # 2 / B * error, one sample a place
        losses.append((per_network * 5 / 2).square().view(2, -1).mean(1))
    found = [row["loss"] for row in learner.metrics(0)]
    assert found == pytest.approx(torch.stack(losses).mean(0).tolist(), rel=1e-5)
    assert [row["q"] for row in learner.metrics(1_000_000)] == [None, None]
    assert learner.metrics(1_000_000)[0]["epsilon"] == pytest.approx(0.51)


def test_tensors_and_progress_are_the_whole_state() -> None:
    """A new learner given every run's tensors and the counters goes on bit for bit."""
    configs = [small_config(rate=r, target_update_every_updates=4) for r in (0.2, 0.5)]
    old, new = make_learner(*configs), make_learner(*configs, seed=99)
    # Its buffers and moments must not matter.
    new.update(in_memory(make_batch(new)), mask_uniforms(new, 2))
    for step in range(3):
        old.update(in_memory(make_batch(old, step)), mask_uniforms(old, 2, step))
    for run in range(2):
        for name, view in old.tensors(run).items():
            new.tensors(run)[name].copy_(view)
    new.resume_at(*old.progress)
    for step in range(3, 6):
        for learner in (old, new):
            learner.update(in_memory(make_batch(old, step)), mask_uniforms(old, 2, step))
    assert torch.equal(new.online.flat, old.online.flat)
    assert torch.equal(new.target.flat, old.target.flat)
    assert new.metrics(0) == old.metrics(0)


@pytest.mark.parametrize(
    "changes",
    [
        *({"rate": -0.1}, {"rate": 1.1}, {"gamma": 2.0}, {"epsilon_final": -1.0}),
        *({"batch_size": 0}, {"update_every_env_steps": 0}, {"learning_rate": -1e-4}),
        *({"f_units": (0, 48)}, {"replay_start_env_steps": -1}, {"replay_capacity": 0}),
    ],
)
def test_impossible_settings_are_refused(changes: dict[str, Any]) -> None:
    """The error names the field."""
    with pytest.raises(ValueError, match=next(iter(changes))):
        Config(**changes)


def test_a_cohort_shares_everything_but_the_rate() -> None:
    """Runs with different settings cannot be stacked; the learner refuses."""
    configs = [Config(rate=0.1), Config(rate=0.5, gamma=0.9)]
    with pytest.raises(ValueError, match="differ in rate only"):
        DCC(configs, registry.make("pursuit-n6"))


def test_continuous_actions_are_refused() -> None:
    """A Q-learner cannot play waterworld; the line says why."""
    with pytest.raises(DefinitionError, match="picks one of several actions"):
        DCC([Config()], registry.make("waterworld-n8"))
