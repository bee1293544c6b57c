"""What is said: the contract of every encoder, and the seam on two more files in the folder.

`again` says the observation, stored apart; `sketch` says eleven numbers about it.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.algorithms.cohort import TORCH
from msgdrop_cli.algorithms.dcc import DCC, Config
from msgdrop_cli.algorithms.hearing import Encoding
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.facts import kernel_name
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.tensors import read_tensors
from msgdrop_cli.engine.training import Training
from msgdrop_cli.kernels.dcc import NAME
from msgdrop_cli.messages import encoders
from msgdrop_cli.messages.received import Received
from msgdrop_cli.ops.minibatch import Minibatch
from msgdrop_cli.records.store import POLICY
from tests.dcc_samples import KERNELS, integers, mask_uniforms, rand, small_config, use_kernel
from tests.runs import StopAt, digest, planned
from tests.toy_encoders.sketch import WIDTH

TOYS = ("again", "sketch")
AGENTS, ROWS, SIZE = 3, 30, 5
LINKS = Channel("links", (0.5,))
CASES = [
    {"network": network, "dropout": dropout, "drops_own": own}
    for network, dropout, own in product(("fgh", "concat"), ("message", "element"), (False, True))
]


@pytest.fixture(autouse=True)
def toys(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Two more files in the folder."""
    folder = Path(__file__).parent / "toy_encoders"
    monkeypatch.setattr(encoders, "__path__", [*encoders.__path__, str(folder)])
    yield
    for toy in TOYS:
        sys.modules.pop(f"msgdrop_cli.messages.encoders.{toy}", None)


def _fill(encoding: Encoding, runs: int) -> None:
    """Weights for every run."""
    for run in range(runs):
        for n, weight in enumerate(encoding.tensors(run).values()):
            weight.copy_(2.0 * rand(*weight.shape, seed=n + 1) - 1.0)


def _sketching(**changes: Any) -> PlannedRun:
    """A run whose encoder learns from little."""
    return planned(encoder="sketch", encoder_samples=500, **changes)


def _learner(dtype: torch.dtype, observation: int, **changes: Any) -> DCC:
    """Two runs of three agents, two rates."""
    env: Any = SimpleNamespace(
        agents=AGENTS, observation_size=observation, observation_dtype=dtype, actions=5
    )
    learner = DCC([small_config(rate=rate, **changes) for rate in (0.3, 0.6)], env)
    learner.initialise(rand(2, learner.init_uniforms, seed=1))
    learner.target.flat.mul_(-0.5)
    _fill(learner.encoding, 2)
    return learner


def _observations(dtype: torch.dtype, *shape: int, seed: int) -> Tensor:
    if dtype == torch.uint8:
        return ((rand(*shape, seed=seed) < 0.3) * integers(4, *shape, seed=seed)).to(dtype)
    return 2.0 * rand(*shape, seed=seed) - 1.0


def _drawn(learner: DCC, dtype: torch.dtype, observation: int, seed: int) -> Minibatch:
    """From a memory of joint observations, and of what is said about each."""
    obs = _observations(dtype, 2, ROWS + 7, AGENTS, observation, seed=seed)
    return Minibatch(
        obs=obs,
        next_row=integers(ROWS + 7, 2, ROWS, seed=seed + 1).int(),
        action=integers(5, 2, ROWS, AGENTS, seed=seed + 2).to(torch.uint8),
        reward=4.0 * rand(2, ROWS, AGENTS, seed=seed + 3) - 2.0,
        discount=(rand(2, ROWS, seed=seed + 4) < 0.8).float(),
        rows=integers(ROWS, 2, AGENTS, SIZE, seed=seed + 5),
        shown=learner.shown_agents,
        messages=learner.encoding.message(obs),
    )


@pytest.mark.parametrize("name", [*encoders.encoders(), *TOYS])
def test_a_message_has_its_width_and_its_own_bits(name: str) -> None:
    """Numbers [R, E, N, M], the same for a run alone and among others, in one game or in many."""
    together, alone = (Encoding(name, 37, runs, "cpu") for runs in (3, 1))
    together.apart = alone.apart = True
    _fill(together, 3)
    _fill(alone, 1)
    obs = integers(3, 3, 8, 4, 37, seed=1).to(torch.uint8)
    said, one = together.message(obs), alone.message(obs[1:2])
    assert said is not None
    assert one is not None
    assert (said.shape, said.dtype) == ((3, 8, 4, together.width), torch.float32)
    assert torch.equal(said[1:2], one)


def test_an_unknown_encoder_is_refused() -> None:
    """With the nearest known one."""
    with pytest.raises(ValueError, match="none is called 'observations'; did you mean 'observat"):
        Config(encoder="observations")


def test_observations_are_not_stored_twice() -> None:
    """By default nothing stands beside them, and who hears nobody stores no messages either."""
    for run in (planned(), planned("fdc", encoder="sketch")):
        training = Training([run.spec])
        assert training.replay.messages is None
        assert training.learner.encoding.message(torch.zeros(1, 1, 6, 147)) is None
    assert Training([planned(encoder="sketch").spec]).replay.messages is not None


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize(
    "changes",
    [{}, {"environment": "navigation-n8"}, {"algorithm": "full-sd"}, {"algorithm": "concat-md"}],
    ids=lambda changes: str(*changes.values()),
)
def test_what_says_the_same_learns_the_same(
    changes: dict[str, Any], kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Observations stored apart: after 80 updates with cut episodes the weights are the default's.

    The same bits in torch, the same up to rounding where bytes are listed and numbers are not.
    """
    use_kernel(kernel, monkeypatch)
    monkeypatch.setattr("msgdrop_cli.engine.training.Training.act", _wander)
    given: dict[str, Any] = {"time_limit": 15, **changes}
    expected, found = (
        Training([planned(**given, encoder=e).spec]) for e in ("observation", "again")
    )
    for training in (expected, found):
        training.begin()
        while training.learner.progress[0] < 80:
            training.advance()
    assert found.replay.messages is not None
    assert torch.equal(found.replay.messages[:, :-1], expected.replay.obs[:, :-1].float())
    tolerance = 0.0 if kernel == "torch" else 2e-4
    for name, weights in expected.learner.tensors(0).items():
        other = found.learner.tensors(0)[name]
        torch.testing.assert_close(other, weights, rtol=tolerance, atol=tolerance)


def _wander(training: Training) -> Tensor:
    """Random actions: a rounding error changes no game."""
    shape = (training.games_each, training.env.agents)
    return training.streams.integers("explore", training.env.actions, *shape)


@pytest.mark.parametrize("observation", [7, 37], ids=["longer messages", "shorter messages"])
@pytest.mark.parametrize("dtype", [torch.uint8, torch.float32], ids=["bytes", "numbers"])
@pytest.mark.parametrize("changes", CASES, ids=lambda case: "-".join(map(str, case.values())))
def test_updates_and_q_are_the_torch_paths(
    changes: dict[str, Any],
    dtype: torch.dtype,
    observation: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Three updates and Q_exec over broken links agree within 1e-5, where the C file serves."""
    given = {**changes, "encoder": "sketch"}
    use_kernel(NAME, monkeypatch)
    ours = _learner(dtype, observation, **given)
    with monkeypatch.context() as patch:
        use_kernel("torch", patch)
        oracle = _learner(dtype, observation, **given)
    both_kinds = dtype == torch.uint8 and changes["network"] == "concat"
    assert (ours._computes is ours, oracle._computes is oracle) == (both_kinds, True)
    for step in range(3):
        drawn, uniforms = _drawn(ours, dtype, observation, 10 * step), mask_uniforms(ours, 2, step)
        for learner in (ours, oracle):
            learner.update(drawn, uniforms)
        torch.testing.assert_close(ours.online.flat, oracle.online.flat, rtol=0, atol=1e-5)
        for name, moment in oracle.adam.moments.items():
            scale = moment.flat.abs().max().item()
            moments = ours.adam.moments[name].flat
            torch.testing.assert_close(moments, moment.flat, rtol=1e-5, atol=1e-5 * scale)
    obs = _observations(dtype, 2, 131, AGENTS, observation, seed=5)
    keep = integers(2, 2, 131, AGENTS, AGENTS - 1, seed=6).float()
    width = ours.encoding.width
    old = _observations(dtype, 2, 131, AGENTS, AGENTS - 1, width, seed=7)
    old = old.float() if ours.encoding.apart else old
    for received in (None, Received(keep), Received(keep, old)):
        found, expected = ours.q_exec(obs, received), oracle.q_exec(obs, received)
        torch.testing.assert_close(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_broken_link_silences_a_message_of_any_width(
    kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Agent 0 without the link to 2: what 2 sees changes nothing, and 1 is still heard."""
    use_kernel(kernel, monkeypatch)
    learner = _learner(torch.uint8, 37, encoder="sketch")
    obs, keep = integers(3, 2, 20, AGENTS, 37, seed=3), torch.ones(2, 20, AGENTS, 2)
    keep[:, :, 0, 1] = 0.0
    before = learner.q_exec(obs, Received(keep))[:, :, 0]
    for agent, matters in ((2, False), (1, True)):
        changed = obs.clone()
        changed[:, :, agent] = 2 - changed[:, :, agent]
        after = learner.q_exec(changed, Received(keep))[:, :, 0]
        assert torch.equal(after, before) != matters, agent


def test_single_elements_of_a_message_are_dropped_by_themselves() -> None:
    """SD: as many numbers of the mask as a message has are used, and the own block stays whole."""
    learner = _learner(torch.uint8, 37, encoder="sketch", dropout="element")
    keep = learner.binary_mask(mask_uniforms(learner, 2))
    assert keep.shape == (2 * AGENTS, SIZE, AGENTS, 37)
    om = (torch.ones(6, SIZE, 1, 37), torch.ones(6, SIZE, 2, WIDTH))
    given: list[Tensor] = []
    learner.network.forward = lambda weights, inputs: given.append(inputs) or inputs  # type: ignore
    learner.q(learner.online, om, keep)
    own, messages = given[0].split([37, 2 * WIDTH], -1)
    assert bool((own == 1).all())
    assert torch.equal(messages.view(6, SIZE, 2, WIDTH), keep[:, :, 1:, :WIDTH])


@pytest.mark.parametrize(
    ("changes", "kernel"),
    [
        ({}, NAME),
        ({"environment": "navigation-n8", "algorithm": "concat-md"}, NAME),
        ({"algorithm": "concat-md"}, TORCH),
    ],
    ids=str,
)
def test_a_run_says_who_computes_it(
    changes: dict[str, Any], kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A layer that sees bytes and numbers is torch's."""
    use_kernel(NAME, monkeypatch)
    assert kernel_name(planned(**changes, encoder="sketch").spec, "cpu") == kernel


def test_messages_survive_a_stop_and_a_cohort(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopped and resumed, or stacked with another run, a run has the bits that it has alone."""
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
    run, other = _sketching(), _sketching(seed=2, rate=0.5)
    [alone] = train_cohort([run], tmp_path / "alone")
    stacked = train_cohort([other, run], tmp_path / "together")
    train_cohort([run], tmp_path / "stopped", stop=StopAt(50))
    [resumed] = train_cohort([run], tmp_path / "stopped")
    assert [o.status for o in (alone, *stacked, resumed)] == ["done"] * 4
    assert digest(stacked[1].path) == digest(alone.path) == digest(resumed.path)
    assert len(evaluate(alone.path, channel=LINKS, episodes=3)) == 3


def test_a_policy_takes_its_encoder_along(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The weights of the encoder stand in policy.safetensors, and evaluation reads them there."""
    run = _sketching(train_env_steps=80)
    [outcome] = train_cohort([run], tmp_path)
    heard: list[Tensor] = []
    message = Encoding.message

    def listened(encoding: Encoding, obs: Tensor) -> Tensor | None:
        heard.append(encoding.tensors(0)["encoder.sketch.weight"])
        return message(encoding, obs)

    monkeypatch.setattr(Encoding, "message", listened)
    evaluate(outcome.path, channel=LINKS, episodes=2)
    policy = read_tensors(outcome.path / POLICY)
    assert torch.equal(heard[0], policy["encoder.sketch.weight"])
    assert bool(heard[0].any())
    assert '"encoder": "sketch"' in (outcome.path / "run.json").read_text()


def test_only_another_encoder_gives_another_id() -> None:
    """The default does not stand in the id: published ids stay."""
    assert planned().run_id == planned(encoder="observation").run_id
    assert planned(encoder="again").run_id != planned().run_id
    assert replace(planned(encoder="again").spec.algorithm_config, encoder="observation") == (
        planned().spec.algorithm_config
    )
