"""Who is dropped, and what the networks are given."""

import math
from dataclasses import replace
from itertools import combinations
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.algorithms.dcc import DCC, NAMED
from msgdrop_cli.engine.training import Training
from msgdrop_cli.messages.received import Received
from msgdrop_cli.ops.minibatch import Minibatch
from tests.dcc_samples import (
    AGENTS,
    OBSERVATION,
    integers,
    make_batch,
    make_learner,
    mask_uniforms,
    small_config,
    use_kernel,
)
from tests.minibatches import in_memory
from tests.runs import planned


@pytest.fixture(autouse=True)
def torch_path(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The inputs of the networks are seen on the torch path only."""
    if "at_rate_1" not in request.node.name:
        use_kernel("torch", monkeypatch)


def _recorded(learner: DCC, monkeypatch: pytest.MonkeyPatch) -> list[Tensor]:
    """What the networks are given from now on, call by call, [G, rows, inputs] each."""
    given: list[Tensor] = []
    forward = learner.network.forward

    def record(weights: Any, inputs: Tensor) -> Any:
        given.append(inputs.detach().clone())
        return forward(weights, inputs)

    monkeypatch.setattr(learner.network, "forward", record)
    return given


def _given(learner: DCC, monkeypatch: pytest.MonkeyPatch) -> list[Tensor]:
    """What the networks are given in one update on observations of ones, [R, N, B, 1+S, O] each.

    The online network now, the online network next, the target network next.
    """
    given = _recorded(learner, monkeypatch)
    runs = learner.online.networks // AGENTS
    batch = make_batch(learner)
    ones = batch._replace(obs=torch.ones_like(batch.obs))
    learner.update(in_memory(ones), mask_uniforms(learner, runs))
    shown = learner.shown_agents.shape[1]
    return [part.view(runs, AGENTS, -1, shown, OBSERVATION) for part in given]


@pytest.mark.parametrize("name", ["dcc-md", "dcc-sd", "full-md", "full-sd", "concat-md"])
def test_drops_the_right_units_independently(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole messages or single elements are dropped with probability rate, independently.

    Shares and correlations between samples, agents, senders and elements stay within five
    standard deviations of independent binomials. The own block is only dropped by Full variants.
    """
    rate, size = 0.2, 4_000
    named = dict(NAMED[name])
    learner = make_learner(small_config(**{**named, "rate": rate, "batch_size": size}))
    keep = _given(learner, monkeypatch)[0][0]  # [N, B, 1+S, O]
    if not named.get("drops_own"):
        assert (keep[:, :, 0] == 1.0).all()
        keep = keep[:, :, 1:]
    if named.get("dropout") != "element":
        assert torch.equal(keep, keep[..., :1].expand_as(keep))
        keep = keep[..., :1]
    assert set(keep.unique().tolist()) == {0.0, 1.0}
    units = keep.transpose(0, 1).flatten(1)  # [B, N * units]
    sigma = math.sqrt(rate * (1 - rate) / size)
    assert (units.mean(0) - (1 - rate)).abs().max() < 5 * sigma
    centred = (units - (1 - rate)) / math.sqrt(rate * (1 - rate))
    same_sample = centred.T @ centred / size
    next_sample = centred[1:].T @ centred[:-1] / size
    correlations = torch.cat((same_sample - same_sample.diagonal().diag(), next_sample))
    assert correlations.abs().max() < 6 / math.sqrt(size)


@pytest.mark.parametrize("name", ["dcc-md", "dcc-sd", "full-md", "full-sd", "concat-md"])
def test_same_mask_for_m_and_next_m(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The target network is given m' with the mask of m, the selecting one m' scaled (l. 241)."""
    configs = [small_config(**{**NAMED[name], "rate": rate}) for rate in (0.4, 0.0, 1.0)]
    now, after, after_masked = _given(make_learner(*configs), monkeypatch)
    assert torch.equal(now, after_masked)
    first = 0 if NAMED[name].get("drops_own") else 1
    for run, rate in enumerate((0.4, 0.0, 1.0)):
        torch.testing.assert_close(after[run, ..., first:, :].unique(), torch.tensor([1 - rate]))
        dropped = 1 - now[run, ..., first:, :].mean().item()
        assert dropped == rate if rate in (0.0, 1.0) else 0.2 < dropped < 0.6
    assert first == 0 or (after[..., 0, :] == 1.0).all()


@pytest.mark.parametrize("name", ["dcc-md", "dcc-sd", "full-md", "full-sd"])
@pytest.mark.parametrize("arrives", [1.0, 0.0])
def test_what_is_dropped_of_the_own_is_scaled_when_acting(
    name: str, arrives: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By 1 - rate as the messages are, and no link takes it away (l. 173, 489, 525)."""
    learner = make_learner(small_config(**{**NAMED[name], "rate": 0.4}))
    given = _recorded(learner, monkeypatch)
    received = Received(torch.full((1, 5, AGENTS, AGENTS - 1), arrives))
    learner.q_exec(torch.ones(1, 5, AGENTS, OBSERVATION), received)
    blocks = given[0].view(AGENTS, 5, AGENTS, OBSERVATION)
    own = 0.6 if NAMED[name].get("drops_own") else 1.0
    torch.testing.assert_close(blocks[:, :, 0].unique(), torch.tensor([own]))
    torch.testing.assert_close(blocks[:, :, 1:].unique(), torch.tensor([0.6 * arrives]))


@pytest.mark.parametrize("dropout", ["message", "element"])
def test_every_update_draws_a_mask_of_its_own(
    dropout: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The masks change at each training time (l. 258): two differ in 2 * 0.3 * 0.7 of the units.

    Each minibatch of the loop is replaced by ones, so that what the networks see is the mask.
    """
    run = planned("dcc-md", dropout=dropout, rate=0.3, replay_start_env_steps=8).spec
    training = Training([run])
    training.begin()
    learner: Any = training.learner
    given, update = _recorded(learner, monkeypatch), learner.update
    unit = 147 if dropout == "element" else 1
    masks: list[Tensor] = []

    def on_ones(minibatch: Minibatch, uniforms: Tensor) -> None:
        given.clear()  # what acting left behind
        update(replace(minibatch, obs=torch.ones_like(minibatch.obs)), uniforms)
        masks.append(given[2].view(6, 32, 6, 147)[:, :, 1:, :unit])  # m~' for the target network

    monkeypatch.setattr(learner, "update", on_ones)
    while len(masks) < 4:
        training.advance()
    sigma = math.sqrt(0.42 * 0.58 / masks[0].numel())
    for one, other in combinations(masks, 2):
        assert abs((one != other).float().mean().item() - 0.42) < 5 * sigma


@pytest.mark.parametrize("network", ["fgh", "concat"])
@pytest.mark.parametrize("dropout", ["message", "element"])
def test_at_rate_1_messages_do_not_matter(network: str, dropout: str) -> None:
    """At rate 1 neither the policy's Q-values nor three updates depend on messages; at 0.9 both."""
    for rate in (1.0, 0.9):
        config = small_config(rate=rate, network=network, dropout=dropout)
        one, other = make_learner(config), make_learner(config)
        obs = integers(3, 1, 20, AGENTS, OBSERVATION, seed=3)
        changed = obs.clone()
        changed[:, :, 1:] = 2 - changed[:, :, 1:]
        assert torch.equal(one.q_exec(obs)[:, :, 0], one.q_exec(changed)[:, :, 0]) == (rate == 1)
        for seed in range(3):
            batch, uniforms = make_batch(one, seed), mask_uniforms(one, seed=seed)
            one.update(in_memory(batch), uniforms)
            swapped = batch.obs.clone()
            swapped[:, :, 1:] = 2 - swapped[:, :, 1:]
            other.update(in_memory(batch._replace(obs=swapped)), uniforms)
        assert torch.equal(one.online.flat, other.online.flat) == (rate == 1)


def test_fdc_is_shown_its_own_observation_only() -> None:
    """FDC's Q-values depend on nobody else, and no link can break."""
    learner = make_learner(small_config(**NAMED["fdc"]))
    obs = integers(3, 1, 20, AGENTS, OBSERVATION, seed=3)
    q = learner.q_exec(obs)
    obs[:, :, 1:] = 2 - obs[:, :, 1:]
    assert torch.equal(
        learner.q_exec(obs, Received(torch.zeros(1, 20, AGENTS, 2)))[:, :, 0], q[:, :, 0]
    )
    assert learner.update_uniforms == 0
