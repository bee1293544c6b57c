"""The update in C against the torch path, which is its oracle; its bits are each network's own."""

from dataclasses import fields, replace
from itertools import product
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.algorithms.cohort import TORCH
from msgdrop_cli.algorithms.dcc import DCC, Config
from msgdrop_cli.algorithms.discovery import learner_class
from msgdrop_cli.engine.facts import kernel_name
from msgdrop_cli.kernels.build import library
from msgdrop_cli.kernels.dcc import NAME
from msgdrop_cli.kernels.structs import adam
from msgdrop_cli.messages.received import Received
from msgdrop_cli.ops.minibatch import Minibatch
from msgdrop_envs import registry
from tests.dcc_samples import integers, mask_uniforms, rand, use_kernel
from tests.minibatches import in_memory
from tests.runs import planned

pytestmark = pytest.mark.skipif(library() is None, reason="no C compiler, or MSGDROP_KERNEL=torch")
AGENTS, OBSERVATION, ROWS, SIZE = 3, 37, 50, 9
"""No multiples of anything: rows and units have remainders."""
CASES = [
    {"network": network, "dropout": dropout, "drops_own": own, "loss": loss}
    for network, dropout, own, loss in product(
        ("fgh", "concat", "own"), ("message", "element"), (False, True), ("mse", "huber")
    )
    if not (network == "own" and (own or dropout == "element"))
]


def _learner(dtype: torch.dtype, *rates: float, **changes: Any) -> DCC:
    """Networks with a remainder of each kind in the vectors of a row: 3, 2 + 2, 3 + 3 + 3, 1."""
    sizes: dict[str, Any] = {"f_units": (64, 48), "g_units": 144, "h_units": 16}
    fast = {"batch_size": SIZE, "learning_rate": 1e-4, "gamma": 0.9}
    env: Any = SimpleNamespace(
        agents=AGENTS, observation_size=OBSERVATION, observation_dtype=dtype, actions=5
    )
    return DCC([Config(**{**sizes, **fast, **changes}, rate=rate) for rate in rates], env)


def _pair(dtype: torch.dtype, monkeypatch: pytest.MonkeyPatch, **changes: Any) -> tuple[DCC, DCC]:
    """Two runs of two rates in C and in torch, with equal weights; the target has others."""
    ours = _learner(dtype, 0.3, 0.6, **changes)
    with monkeypatch.context() as patch:
        use_kernel("torch", patch)
        oracle = _learner(dtype, 0.3, 0.6, **changes)
    for learner in (ours, oracle):
        learner.initialise(rand(2, learner.init_uniforms, seed=1))
        learner.target.flat.mul_(-0.5)
    assert (ours._computes is ours, oracle._computes is oracle) == (False, True)
    return ours, oracle


def _observations(dtype: torch.dtype, *shape: int, seed: int) -> Tensor:
    """Bytes that are mostly 0, the largest ones too; or numbers around 0."""
    if dtype == torch.float32:
        return 2.0 * rand(*shape, seed=seed) - 1.0
    ones = rand(*shape, seed=seed) < 0.15
    counts = ones * integers(6, *shape, seed=seed + 1)
    counts[0, 0] = counts[0, 0].clamp(max=1) * 255
    return counts.to(dtype)


def _drawn(learner: DCC, dtype: torch.dtype, seed: int) -> Minibatch:
    """From memories with more rows of observations than of the rest; some rows are drawn twice."""
    runs = learner.online.networks // AGENTS
    return Minibatch(
        obs=_observations(dtype, runs, ROWS + 7, AGENTS, OBSERVATION, seed=seed),
        next_row=integers(ROWS + 7, runs, ROWS, seed=seed + 1).int(),
        action=integers(5, runs, ROWS, AGENTS, seed=seed + 2).to(torch.uint8),
        reward=4.0 * rand(runs, ROWS, AGENTS, seed=seed + 3) - 2.0,
        discount=(rand(runs, ROWS, seed=seed + 4) < 0.8).float(),
        rows=integers(ROWS, runs, AGENTS, SIZE, seed=seed + 5),
        shown=learner.shown_agents,
    )


@pytest.mark.parametrize("dtype", [torch.uint8, torch.float32], ids=["bytes", "numbers"])
@pytest.mark.parametrize("changes", CASES, ids=lambda case: "-".join(map(str, case.values())))
def test_update_is_the_torch_paths(
    changes: dict[str, Any], dtype: torch.dtype, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three updates: losses, Q, moments (so gradients) and weights agree within 1e-5.

    Of a gradient that cancels but for rounding Adam makes a whole step: such weights are left out.
    """
    ours, oracle = _pair(dtype, monkeypatch, **changes)
    cancelled = torch.zeros_like(oracle.online.flat, dtype=torch.bool)
    for step in range(3):
        batch, uniforms = _drawn(ours, dtype, 10 * step), mask_uniforms(ours, 2, step)
        for learner in (ours, oracle):
            learner.update(batch, uniforms)
        size = oracle.adam.moments["exp_avg_sq"].flat.sqrt()
        cancelled |= (size > 0) & (size < 1e-9 * size.max())
        assert cancelled.float().mean() < 1e-3
        for part in ("online", "target"):
            learners = (ours, oracle)
            found, expected = (getattr(one, part).flat[~cancelled] for one in learners)
            torch.testing.assert_close(found, expected, rtol=0, atol=1e-5)
        for name, moment in oracle.adam.moments.items():
            scale = moment.flat.abs().max().item()
            found = ours.adam.moments[name].flat
            torch.testing.assert_close(found, moment.flat, rtol=1e-5, atol=1e-5 * scale)
    for found, expected in zip(ours.metrics(0), oracle.metrics(0), strict=True):
        assert found == pytest.approx(expected, rel=1e-5)


def test_what_a_moment_takes_of_a_gradient_is_rounded_once() -> None:
    """1 - beta2 is 0.001 to the last bit; computed with a rounded beta2 it is 5e-5 too much."""
    assert adam(1e-4, 1).new2 == torch.tensor(0.001).item()


@pytest.mark.parametrize("dtype", [torch.uint8, torch.float32], ids=["bytes", "numbers"])
@pytest.mark.parametrize("network", ["fgh", "concat", "own"])
@pytest.mark.parametrize("games", [1, 8, 131])
def test_q_values_are_the_torch_paths(
    games: int, network: str, dtype: torch.dtype, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Q_exec of one game, of several and of many, with all links and with broken ones."""
    ours, oracle = _pair(dtype, monkeypatch, network=network)
    obs = _observations(dtype, 2, games, AGENTS, OBSERVATION, seed=5)
    keep = integers(2, 2, games, AGENTS, AGENTS - 1, seed=6).float()
    for given in (None, Received(keep)):
        found, expected = ours.q_exec(obs, given), oracle.q_exec(obs, given)
        torch.testing.assert_close(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("dtype", [torch.uint8, torch.float32], ids=["bytes", "numbers"])
def test_a_copy_of_the_observations_gives_the_same_bits(dtype: torch.dtype) -> None:
    """It does not matter whether the minibatch is read in the memory or was put together."""
    one, other = _learner(dtype, 0.3), _learner(dtype, 0.3)
    for learner in (one, other):
        learner.initialise(rand(1, learner.init_uniforms, seed=1))
    batch = _drawn(one, dtype, 3)
    one.update(batch, mask_uniforms(one))
    other.update(in_memory(batch.copied()), mask_uniforms(one))
    assert torch.equal(one.online.flat, other.online.flat)


@pytest.mark.parametrize("dtype", [torch.uint8, torch.float32], ids=["bytes", "numbers"])
def test_a_networks_bits_are_its_own(dtype: torch.dtype) -> None:
    """The second of three stacked runs has the bits that it has alone."""
    cohort, alone = _learner(dtype, 0.1, 0.4, 0.9), _learner(dtype, 0.4)
    uniforms = rand(3, cohort.init_uniforms, seed=1)
    cohort.initialise(uniforms)
    alone.initialise(uniforms[1:2])
    for step in range(3):
        drawn, masks = _drawn(cohort, dtype, step), mask_uniforms(cohort, 3, step)
        parts = {field.name: getattr(drawn, field.name) for field in fields(drawn)}
        parts = {name: part for name, part in parts.items() if part is not None}
        second = {name: part[1:2] for name, part in parts.items() if name != "shown"}
        cohort.update(drawn, masks)
        alone.update(replace(drawn, **second), masks[1:2])
    for name, view in alone.tensors(0).items():
        assert torch.equal(view, cohort.tensors(1)[name]), name


@pytest.mark.parametrize("dtype", [torch.uint8, torch.float32], ids=["bytes", "numbers"])
@pytest.mark.parametrize("layer", ["f1", "f2", "g1", "h1", "h2"])
def test_what_is_not_a_number_is_seen(
    layer: str, dtype: torch.dtype, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A NaN in any layer of one network reaches what the torch path lets it reach, and no other."""
    ours, oracle = _pair(dtype, monkeypatch)
    batch, uniforms = _drawn(ours, dtype, 3), mask_uniforms(ours, 2)
    for learner in (ours, oracle):
        learner.online[layer].bias[1, 0, 0] = float("nan")
        learner.update(batch, uniforms)
    for name, expected in oracle.tensors(0).items():
        if "." in name:  # zero bytes times NaN are skipped, so that single weights may differ
            reached = ours.tensors(0)[name].isnan().flatten(1).any(1)
            assert torch.equal(reached, expected.isnan().flatten(1).any(1)), name
    assert [row["loss"] != row["loss"] for row in ours.metrics(0)] == [True, False]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, NAME),
        ({"environment": "navigation-n8"}, NAME),
        ({"algorithm": "fdc"}, NAME),
        ({"max_gradient_norm": 0.5}, TORCH),
        ({"g_units": 100}, TORCH),
    ],
)
def test_a_run_says_what_it_computes_with(changes: dict[str, Any], expected: str) -> None:
    """The paper's settings are compiled; what the C file does not know is torch's, and says so."""
    spec = planned(**changes).spec
    assert kernel_name(spec, "cpu") == expected
    env, learner = registry.make(spec.environment_config), learner_class(spec.algorithm)
    assert learner.kernel(spec.algorithm_config, env, "cuda") == TORCH


def test_observations_beyond_two_bytes_are_torchs() -> None:
    """dcc.c numbers what it finds in a block with 16 bits: 73 cells of sight fit, 74 do not."""
    for sight, name in ((73, NAME), (74, TORCH)):
        config = replace(registry.settings()["pursuit-n6"], sight=sight)
        assert DCC.kernel(Config(), registry.make(config), "cpu") == name
