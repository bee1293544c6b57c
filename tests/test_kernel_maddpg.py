"""MADDPG's update in C against the torch path, its oracle; a run's bits are its own."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from msgdrop_cli.algorithms.cohort import TORCH
from msgdrop_cli.algorithms.discovery import learner_class
from msgdrop_cli.algorithms.maddpg import MADDPG, Config
from msgdrop_cli.engine.facts import kernel_name
from msgdrop_cli.kernels.build import library
from msgdrop_cli.kernels.maddpg import NAME
from msgdrop_cli.ops.minibatch import Minibatch
from msgdrop_envs import registry
from tests.dcc_samples import integers, rand
from tests.maddpg_samples import mask_uniforms, torch_only
from tests.minibatches import in_memory
from tests.runs import planned

pytestmark = pytest.mark.skipif(library() is None, reason="no C compiler, or MSGDROP_KERNEL=torch")
AGENTS, OBSERVATION, ACTION, ROWS, SIZE = 3, 37, 2, 50, 9
ENV: Any = SimpleNamespace(
    agents=AGENTS,
    observation_size=OBSERVATION,
    observation_dtype=torch.float32,
    actions=0,
    action_size=ACTION,
)
"""No multiples of anything: rows, units and widths have remainders."""
CASES: dict[str, dict[str, Any]] = {
    "maddpg-md": {},
    "not clipped": {"max_gradient_norm": 0.0},
    "hardly clipped": {"max_gradient_norm": 0.8},
    "masked actions": {"masks_actions": True},
    "ddpg": {"network": "own"},
    "vanilla": {"network": "concat"},
    "vanilla, masked actions": {"network": "concat", "masks_actions": True},
    "actor each third time": {"actor_update_every_env_steps": 15},
    "whole vectors": {"f_units": (16, 32), "g_units": 64, "tau": 0.7},
}


def _learner(*rates: float, **changes: Any) -> MADDPG:
    """Networks with rows of 4 and 6 vectors, of 4, of 5; targets that are other networks."""
    sizes = {"f_units": (150, 50), "g_units": 71, "h_units": 32, "actor_units": 16}
    fast = {"batch_size": SIZE, "learning_rate": 1e-4, "gamma": 0.9, "tau": 0.1}
    learner = MADDPG([Config(**{**sizes, **fast, **changes}, rate=rate) for rate in rates], ENV)
    learner.initialise(rand(len(rates), learner.init_uniforms, seed=1))
    for half in (learner.actors, learner.critics):
        half.target.flat.mul_(-0.5)
    return learner


def _pair(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> tuple[MADDPG, MADDPG]:
    """Two runs of two rates in C and in torch, with equal weights."""
    ours = _learner(0.3, 0.6, **changes)
    with monkeypatch.context() as patch:
        torch_only(patch)
        oracle = _learner(0.3, 0.6, **changes)
    assert (ours._computes is ours, oracle._computes is oracle) == (False, True)
    return ours, oracle


def _drawn(runs: int, seed: int) -> Minibatch:
    """From memories with more rows of observations, mostly zeros; some rows are drawn twice."""
    obs = 2.0 * rand(runs, ROWS + 7, AGENTS, OBSERVATION, seed=seed) - 1.0
    return Minibatch(
        obs=obs * (rand(*obs.shape, seed=seed + 1) < 0.15),
        next_row=integers(ROWS + 7, runs, ROWS, seed=seed + 2).int(),
        action=2.0 * rand(runs, ROWS, AGENTS, ACTION, seed=seed + 3) - 1.0,
        reward=4.0 * rand(runs, ROWS, AGENTS, seed=seed + 4) - 2.0,
        discount=(rand(runs, ROWS, seed=seed + 5) < 0.8).float(),
        rows=integers(ROWS, runs, SIZE, seed=seed + 6),
        shown=torch.arange(AGENTS)[:, None],
    )


@pytest.mark.parametrize("changes", CASES.values(), ids=CASES)
def test_update_is_the_torch_paths(
    changes: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four updates: losses, Q, moments (so gradients), weights and targets within 1e-5."""
    ours, oracle = _pair(monkeypatch, **changes)
    for step in range(4):
        batch, uniforms = _drawn(2, 10 * step), mask_uniforms(ours, 2, step)
        for learner in (ours, oracle):
            learner.update(batch, uniforms)
        for half in ("actors", "critics"):
            found, expected = getattr(ours, half).parts(), getattr(oracle, half).parts()
            for name, part in expected.items():
                scale = 1.0 if name in ("online", "target") else part.flat.abs().max().item()
                torch.testing.assert_close(
                    found[name].flat, part.flat, rtol=1e-5, atol=1e-5 * scale, msg=f"{half} {name}"
                )
    for found, expected in zip(ours.metrics(0), oracle.metrics(0), strict=True):
        assert found == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("games", [1, 8, 40])
def test_actions_are_the_torch_paths(games: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of one game, of several and of more than a minibatch has."""
    ours, oracle = _pair(monkeypatch)
    obs = 2.0 * rand(2, games, AGENTS, OBSERVATION, seed=5) - 1.0
    found, expected = ours.act_greedily(obs), oracle.act_greedily(obs)
    torch.testing.assert_close(found, expected, rtol=1e-5, atol=1e-6)


def test_a_copy_of_the_observations_gives_the_same_bits() -> None:
    """It does not matter whether the minibatch is read in the memory or was put together."""
    one, other = _learner(0.3), _learner(0.3)
    drawn = _drawn(1, 3)
    one.update(drawn, mask_uniforms(one))
    other.update(in_memory(drawn.copied()), mask_uniforms(one))
    assert torch.equal(one.critics.online.flat, other.critics.online.flat)
    assert torch.equal(one.actors.online.flat, other.actors.online.flat)


def test_a_runs_bits_are_its_own() -> None:
    """The second of three stacked runs has the bits that it has alone."""
    cohort, alone = _learner(0.1, 0.4, 0.9), _learner(0.4)
    alone.initialise(rand(3, cohort.init_uniforms, seed=1)[1:2])
    cohort.initialise(rand(3, cohort.init_uniforms, seed=1))
    for step in range(3):
        drawn, masks = _drawn(3, 10 * step), mask_uniforms(cohort, 3, step)
        fields = ("obs", "next_row", "action", "reward", "discount", "rows")
        own = {field: getattr(drawn, field)[1:2].clone() for field in fields}
        cohort.update(drawn, masks)
        alone.update(replace(drawn, **own), masks[1:2])
    for name, view in alone.tensors(0).items():
        assert torch.equal(view, cohort.tensors(1)[name]), name


LAYERS = ["f1", "f2", "g1", "h1", "h2"]


@pytest.mark.parametrize("layer", LAYERS)
@pytest.mark.parametrize("part", ["online", "target"])
def test_what_is_not_a_number_reaches_the_loss(layer: str, part: str) -> None:
    """A NaN in any layer of one run's critic is seen in its loss, and in no other."""
    learner = _learner(0.3, 0.6)
    learner.critics.parts()[part][layer].bias[1, 0, 0] = float("nan")
    learner.update(_drawn(2, 3), mask_uniforms(learner, 2))
    assert [row["loss"] != row["loss"] for row in learner.metrics(0)] == [False, True]


@pytest.mark.parametrize("layer", ["layer1", "layer2"])
def test_an_actor_that_diverged_is_seen(layer: str) -> None:
    """A NaN in one run's actor reaches the loss by way of its target, and no other run."""
    learner = _learner(0.3, 0.6)
    learner.actors.online[layer].bias[0, 0, 0] = float("nan")
    for step in range(2):
        learner.update(_drawn(2, 3), mask_uniforms(learner, 2, step))
    assert [row["loss"] != row["loss"] for row in learner.metrics(0)] == [True, False]


@pytest.mark.parametrize(
    ("changes", "compiled"),
    [
        ({}, True),
        ({"algorithm": "maddpg"}, True),
        ({"algorithm": "ddpg", "environment": "waterworld-n10"}, True),
        ({"max_gradient_norm": 0.0}, True),
        ({"algorithm": "vanilla-maddpg"}, True),
        ({"shares_parameters": False}, False),
        ({"g_units": 40}, False),
        ({"h_units": 60}, False),
        ({"actor_units": 60}, False),
    ],
)
def test_a_run_says_what_it_computes_with(changes: dict[str, Any], compiled: bool) -> None:
    """The paper's settings are compiled; what the C file does not know is torch's, and says so."""
    given = {"algorithm": "maddpg-md", "environment": "waterworld-n8", **changes}
    spec = planned(**given).spec
    assert kernel_name(spec, "cpu") == (NAME if compiled else TORCH)
    env, learner = registry.make(spec.environment_config), learner_class(spec.algorithm)
    assert learner.kernel(spec.algorithm_config, env, "cuda") == TORCH
    built: Any = learner([spec.algorithm_config], env, "cpu")
    assert (built._computes is not built) == compiled
