"""The plain implementation plays the same games and has the same networks as the engine."""

from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn
from torch.nn.utils import parameters_to_vector

from benchmarks import engine
from benchmarks.plain import measure
from benchmarks.plain.dqn import QLearners
from benchmarks.plain.maddpg import MADDPG
from benchmarks.plain.navigation import Navigation
from benchmarks.plain.training import Training
from benchmarks.plain.waterworld import Waterworld
from msgdrop_cli.algorithms.discovery import learner_class
from msgdrop_envs import registry
from msgdrop_envs.navigation import rules as navigation
from msgdrop_envs.waterworld import config as waterworld
from tests.navigation_positions import slow_games
from tests.waterworld_positions import build, closing_in, random_states

LEARNERS = [(name, each) for name, algorithms in measure.CASES.items() for each in algorithms]


def double(tensor: Tensor) -> Any:
    """The same numbers for numpy, in its own precision."""
    return tensor.double().numpy().copy()


def test_navigation_is_the_same_game() -> None:
    """From 200 crowded positions one step gives what the slow reference gives, within 1e-5."""
    config = navigation.PAPER["navigation-n8"]
    generator = torch.Generator().manual_seed(1)
    places, speeds, landmarks = 0.6 * torch.rand(3, 200, 8, 2, generator=generator)
    actions = torch.randint(5, (200, 8), generator=generator).tolist()
    touched = 0
    state = navigation.State(places, speeds, landmarks)
    for number, slow in enumerate(slow_games(config, state)):
        plain = Navigation(8, np.random.default_rng(0))
        plain.positions, plain.velocities, plain.landmarks = (
            double(each[number]) for each in (places, speeds, landmarks)
        )
        obs, rewards, _ = plain.step(actions[number])
        expected = slow.step(actions[number])
        np.testing.assert_allclose(obs, expected.observations, atol=1e-5)
        np.testing.assert_allclose(rewards, expected.rewards, atol=1e-5)
        np.testing.assert_allclose(plain.velocities, slow.velocities, atol=1e-5)
        touched += expected.collisions
    assert touched > 500


def test_waterworld_is_the_same_game() -> None:
    """One step from positions where much meets and nothing is replaced is the engine's step.

    Places, velocities, observations and rewards agree within 1e-5; there are catches among them.
    """
    config = waterworld.PAPER["waterworld-n8"]
    generator = torch.Generator().manual_seed(1)
    env = build(config)
    state = closing_in(random_states(config, 300, generator), config, generator)
    actions = 2 * torch.rand(300, 8, 2, generator=generator) - 1
    after, transition = env.step(state, actions, torch.rand(300, 80, generator=generator))
    compared = catches = 0
    for game in range(300):
        plain = Waterworld(8, 4, np.random.default_rng(0))
        plain.positions = double(state.positions[game])
        plain.velocities = double(state.velocities[game])
        plain.contacts()
        if plain.gone.any():
            continue  # what comes back comes back anywhere
        obs, rewards, _ = plain.step(double(actions[game]))
        np.testing.assert_allclose(plain.positions, after.positions[game], atol=1e-5)
        np.testing.assert_allclose(plain.velocities, after.velocities[game], atol=1e-5)
        np.testing.assert_allclose(rewards, transition.reward[game], atol=1e-5)
        np.testing.assert_allclose(obs, transition.obs[game], atol=1e-5)
        compared += 1
        catches += int(transition.info["catches"][game])
    assert compared >= 50
    assert catches >= 10


def test_waterworld_replaces_what_is_gone() -> None:
    """Met poison comes back outside the obstacle, at most half of `SPEED` fast on each axis."""
    plain = Waterworld(8, 4, np.random.default_rng(0))
    plain.reset()
    plain.positions[20] = plain.positions[0] = 0.1
    plain.contacts()
    assert plain.gone[12]
    plain.replace()
    assert ((plain.positions[20] - 0.5) ** 2).sum() >= 0.23**2
    assert plain.positions[20].tolist() != [0.1, 0.1]
    assert (abs(plain.velocities[20]) <= 0.005).all()


@pytest.mark.parametrize(("environment", "algorithm"), LEARNERS)
def test_networks_have_as_many_parameters(environment: str, algorithm: str) -> None:
    """Together the networks of the plain implementation have the size of the engine's."""
    rng = np.random.default_rng(0)
    plain = measure.learner(environment, algorithm, measure.game(environment, rng), rng)
    spec = engine.spec(environment, algorithm)
    env = registry.make(spec.environment_config)
    ours = learner_class(spec.algorithm)([spec.algorithm_config], env, "cpu").tensors(0)
    assert sum(network_sizes(plain)) == sum(
        tensor.numel() for name, tensor in ours.items() if "online." in name
    )


@pytest.mark.parametrize(("environment", "algorithm"), LEARNERS)
def test_every_plain_network_learns(environment: str, algorithm: str) -> None:
    """A few updates move every network away from where it was, to finite numbers."""
    rng = np.random.default_rng(0)
    game = measure.game(environment, rng)
    learner = measure.learner(environment, algorithm, game, rng)
    before = [parameters_to_vector(n.parameters()).clone() for n in networks(learner)]
    training = Training(game, learner, rng)
    training.warm_up(40)
    for _ in range(20):
        training.env_step()
    after = [parameters_to_vector(n.parameters()) for n in networks(learner)]
    assert all(numbers.isfinite().all() for numbers in after)
    assert all((old != new).any() for old, new in zip(before, after, strict=True))


def networks(learner: Any) -> list[nn.Module]:
    """What a plain learner's optimizers move."""
    if isinstance(learner, QLearners):
        return [agent.online for agent in learner.agents]
    assert isinstance(learner, MADDPG)
    return [learner.actor, learner.critic]


def network_sizes(learner: Any) -> list[int]:
    """Parameters of each network."""
    return [parameters_to_vector(n.parameters()).numel() for n in networks(learner)]
