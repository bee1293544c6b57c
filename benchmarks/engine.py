"""The engine as a training runs it, ready to be measured part by part."""

import time
from collections.abc import Callable, Mapping
from typing import ParamSpec, TypeVar

import torch
from torch import Tensor

from benchmarks.plain.dqn import EPSILON
from benchmarks.plain.measure import WARM_ENV_STEPS
from benchmarks.plain.stopwatch import PARTS
from msgdrop_cli.definition.spec import RunSpec, TrainingSpec
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.engine.training import Training
from msgdrop_envs.protocol import Environment

P = ParamSpec("P")
T = TypeVar("T")
EXPLORATION: Mapping[str, Mapping[str, float]] = {
    "dcc": {"epsilon_start": EPSILON, "epsilon_final": EPSILON},
    "maddpg": {},
}
"""Held at what the plain implementation takes, so that both explore alike."""
WARM_STEPS = 100
"""Steps with learning before anything is measured."""


def spec(environment: str, algorithm: str) -> RunSpec:
    """A run at the paper's settings that learns from its first step on."""
    known = catalogue()
    named = known.algorithm(algorithm)
    return RunSpec(
        environment=environment,
        environment_config=known.environment(environment),
        algorithm=named.learner,
        algorithm_config=named.config_class(
            **known.sizes(environment, named.learner).algorithm,
            **named.overrides,
            **EXPLORATION[named.learner],
            replay_start_env_steps=0,
        ),
        training=TrainingSpec(),
        seed=1,
    )


def prepared(run: RunSpec) -> Training:
    """A warm training whose replay holds as much random play as the plain one's."""
    training = Training([run])
    training.begin()
    while training.env_steps < WARM_ENV_STEPS:
        training.play(random_actions(training.env, 1, training.games_each))
    for _ in range(WARM_STEPS):
        training.advance()
    return training


def random_actions(env: Environment, *batch: int) -> Tensor:
    """Any actions: [*batch, N] or [*batch, N, A]."""
    if env.action_size:
        return torch.rand(*batch, env.agents, env.action_size) * 2 - 1
    return torch.randint(env.actions, (*batch, env.agents))


def measure(
    training: Training, seconds: float, clock: Callable[[], float] = time.perf_counter
) -> dict[str, float]:
    """Train for `seconds`: env_steps_per_s, and act, step, sample, update in ms per env step."""
    spent = dict.fromkeys(PARTS, 0.0)
    first, start = training.env_steps, clock()

    def timed(part: str, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        begin = clock()
        result = call(*args, **kwargs)
        spent[part] += clock() - begin
        return result

    while clock() - start < seconds:
        actions = timed("act", training.act)
        timed("step", training.play, actions)
        for _ in range(training.updates_due()):
            timed("update", training.learn, timed("sample", training.sample))
    took = clock() - start
    steps = training.env_steps - first
    return {"env_steps_per_s": steps / took, **{p: 1e3 * s / steps for p, s in spent.items()}}
