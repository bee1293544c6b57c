"""The contract of every learner that the registry finds, by each of its names."""

import dataclasses
from dataclasses import replace
from types import ModuleType
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.algorithms.cohort import TORCH
from msgdrop_cli.algorithms.dcc import DCC
from msgdrop_cli.algorithms.discovery import learner_class, learners
from msgdrop_cli.definition.spec import RunSpec, TrainingSpec
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.engine.training import Training
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.messages.received import Received
from msgdrop_envs import registry
from tests.dcc_samples import integers, rand, use_kernel

LEARNERS, KNOWN = learners(), catalogue()
CASES = [
    (learner, name, environment)
    for learner, module in LEARNERS.items()
    for name in module.NAMED
    for environment, sized in KNOWN.paper
    if sized == learner and environment in registry.settings()
]
GAMES = 3


def _config(learner: str, name: str, environment: str) -> Any:
    """The named algorithm with the paper's settings, and a memory that is soon full."""
    module = LEARNERS[learner]
    early = {"replay_start_env_steps": GAMES, "replay_capacity": 60, "batch_size": 8}
    sizes = KNOWN.sizes(environment, learner).algorithm
    return module.Config(**{**sizes, **module.NAMED[name], **early})


def _training(learner: str, name: str, environment: str, seeds: int = 1) -> Training:
    """A cohort whose games end soon, its networks and games begun."""
    config = _config(learner, name, environment)
    spec = RunSpec(
        environment=environment,
        environment_config=replace(registry.settings()[environment], time_limit=9),
        algorithm=learner,
        algorithm_config=config,
        training=TrainingSpec(games=GAMES),
        seed=1,
    )
    training = Training([replace(spec, seed=seed) for seed in range(1, seeds + 1)])
    training.begin()
    return training


def _updated(learner: str, name: str, environment: str, seeds: int = 1) -> Training:
    """The same after its first updates."""
    training = _training(learner, name, environment, seeds)
    while not training.learner.progress[0]:
        training.advance()
    return training


def test_the_registry_finds_the_papers_learners() -> None:
    """Otherwise nothing below would be tested."""
    assert {"dcc", "maddpg"} <= set(LEARNERS)
    assert len(CASES) >= 40


@pytest.mark.parametrize("learner", LEARNERS)
def test_module_has_what_the_registry_promises(learner: str) -> None:
    """A frozen Config, NAMED algorithms, sizes for some environment, and the class."""
    module = LEARNERS[learner]
    assert isinstance(module, ModuleType)
    with pytest.raises(dataclasses.FrozenInstanceError):
        module.Config().rate = 0.5
    fields = {field.name for field in dataclasses.fields(module.Config)}
    required = {"rate", "batch_size", "replay_capacity", "replay_start_env_steps"}
    assert required | {"update_every_env_steps"} <= fields
    assert module.NAMED
    assert learner in {sized for _, sized in KNOWN.paper}
    assert learner_class(learner) is getattr(module, learner.upper())


@pytest.mark.parametrize("learner", LEARNERS)
@pytest.mark.parametrize("rate", [-0.01, 1.01, float("nan")])
def test_impossible_rates_are_refused(learner: str, rate: float) -> None:
    """A probability lies between 0 and 1; both ends are allowed."""
    config_class = LEARNERS[learner].Config
    with pytest.raises(ValueError, match="rate"):
        config_class(rate=rate)
    assert (config_class(rate=0.0).rate, config_class(rate=1.0).rate) == (0.0, 1.0)


@pytest.mark.parametrize(("learner", "name", "environment"), CASES)
def test_acts_for_every_agent_in_every_game(learner: str, name: str, environment: str) -> None:
    """Choices [R, E, N] or numbers in [-1, 1], exploring or greedy, with and without links."""
    training = _training(learner, name, environment, seeds=2)
    env, made = training.env, training.learner
    batch = (2, GAMES, env.agents)
    obs = integers(3, *batch, env.observation_size, seed=1).to(env.observation_dtype)
    uniforms = rand(*batch, made.act_uniforms, seed=2)
    broken = torch.zeros(*batch, env.agents - 1)
    for actions in (
        made.act(obs, uniforms, 0),
        made.act(obs, uniforms, 10**9),
        made.act_greedily(obs),
        made.act_greedily(obs, Received(broken)),
    ):
        if env.actions:
            assert (actions.shape, actions.dtype) == (batch, torch.int64)
            assert actions.min() >= 0
            assert actions.max() < env.actions
        else:
            assert (actions.shape, actions.dtype) == ((*batch, env.action_size), torch.float32)
            assert actions.abs().max() <= 1.0
    shown = made.shown_agents
    assert shown.shape[0] == env.agents
    assert shown[:, 0].tolist() == list(range(env.agents))
    assert all(len(set(row)) == len(row) for row in shown.tolist())


@pytest.mark.parametrize(("learner", "name", "environment"), CASES)
def test_updates_move_finite_weights(learner: str, name: str, environment: str) -> None:
    """The first updates on random play change every agent's policy, without a NaN anywhere."""
    training = _training(learner, name, environment)
    before = {key: view.clone() for key, view in training.learner.policy(0).items()}
    while not training.learner.progress[0]:
        training.advance()
    assert training.learner.progress[0] == 1
    for key, view in training.learner.tensors(0).items():
        assert view.isfinite().all(), key
    after = training.learner.policy(0)
    moved = [(after[key] != before[key]).flatten(1).any(1) for key in before]
    assert torch.stack(moved).any(0).all()
    [row] = training.learner.metrics(training.env_steps)
    assert all(value is not None for value in row.values())
    assert torch.tensor([value or 0.0 for value in row.values()]).isfinite().all()


@pytest.mark.parametrize(("learner", "name", "environment"), CASES)
def test_what_computes_the_rule_is_the_rule(
    learner: str, name: str, environment: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kernel's first update is the one that the learner's own file says, up to rounding.

    A learner whose rule is not reached, because another's kernel computes, fails here.
    """
    fast = _updated(learner, name, environment).learner
    with monkeypatch.context() as patch:
        use_kernel("torch", patch)
        written = _updated(learner, name, environment).learner
    # 1e-3: Adam's first step is the learning rate times the gradient's sign, which may flip at 0.
    expected = written.tensors(0)
    for key, view in fast.tensors(0).items():
        moved = "online" in key or "exp_avg" in key
        torch.testing.assert_close(view, expected[key], rtol=1e-3, atol=1e-6 if moved else 1e-5)


class Stubborn(DCC):
    """A rule of somebody's own: nothing is ever learnt."""

    def minimise(self, drawn: Any, by: Any, step: int) -> tuple[Tensor, Tensor]:
        """Nothing."""
        size = self.config.batch_size
        return torch.zeros(6, size), torch.zeros(6, 2 * size, 5)


def test_a_subclass_of_a_learner_computes_its_own_rule() -> None:
    """DCC's kernel computes DCC's rule, so it serves no subclass."""
    config, env = _config("dcc", "dcc-md", "pursuit-n6"), registry.make("pursuit-n6")
    assert Stubborn.kernel(config, env, "cpu") == TORCH
    made = Stubborn([config], env)
    made.initialise(rand(1, made.init_uniforms, seed=1))
    before = made.online.flat.clone()
    training = _training("dcc", "dcc-md", "pursuit-n6")
    while not training.updates_due():
        training.advance()
    made.update(training.sample(), rand(1, made.update_uniforms, seed=2))
    assert torch.equal(made.online.flat, before)


def _copied(views: Any) -> dict[str, Tensor]:
    return {key: view.clone() for key, view in views.items()}


@pytest.mark.parametrize(("learner", "name", "environment"), CASES)
def test_tensors_and_policy_are_views_that_round_trip(
    learner: str, name: str, environment: str
) -> None:
    """Written into another learner's views they make it act alike; the other run stays."""
    trained = _updated(learner, name, environment, seeds=2).learner
    fresh = _training(learner, name, environment, seeds=2).learner
    other = _copied(fresh.tensors(1))
    for views in ("tensors", "policy"):
        for key, view in getattr(trained, views)(0).items():
            getattr(fresh, views)(0)[key].copy_(view)
        for key, view in getattr(trained, views)(0).items():
            assert torch.equal(getattr(fresh, views)(0)[key], view), key
    for key, view in fresh.tensors(1).items():
        assert torch.equal(view, other[key]), key
    env = registry.make(environment)
    shape = (2, 64, env.agents, env.observation_size)
    obs = integers(3, *shape, seed=3).to(env.observation_dtype)
    assert torch.equal(fresh.act_greedily(obs)[0], trained.act_greedily(obs)[0])
    fresh.resume_at(*trained.progress)
    assert fresh.progress == trained.progress
    for view in fresh.policy(0).values():
        view.zero_()
    assert len(fresh.act_greedily(obs)[0].unique()) == 1  # nothing tells observations apart


@pytest.mark.parametrize("algorithm", ["dcc", "concat-md", "maddpg", "vanilla-maddpg"])
def test_one_agent_alone_has_nobody_to_hear(algorithm: str) -> None:
    """A network without senders would begin with weights that are no numbers."""
    named = KNOWN.algorithm(algorithm)
    games = {"dcc": "pursuit-n6", "maddpg": "waterworld-n8"}
    alone = {"pursuers": 1} | ({"catchers": 1} if named.learner == "maddpg" else {})
    config = dataclasses.replace(KNOWN.environment(games[named.learner]), **alone)
    make = learner_class(named.learner)
    with pytest.raises(DefinitionError, match="one agent alone has nobody to hear"):
        make([named.config_class(**named.overrides)], registry.make(config), "cpu")
    own = {"dcc": "fdc", "maddpg": "ddpg"}[named.learner]
    overrides = KNOWN.algorithm(own).overrides
    make([named.config_class(**overrides)], registry.make(config), "cpu")
