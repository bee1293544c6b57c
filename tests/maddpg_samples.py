"""A tiny team with continuous actions, learners on it and joint minibatches for it."""

from types import SimpleNamespace
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.algorithms.maddpg import MADDPG, Config
from msgdrop_cli.ops.minibatch import Batch
from tests.dcc_samples import rand

AGENTS, OBSERVATION, ACTION, SIZE = 3, 7, 2, 5
TINY: Any = SimpleNamespace(
    agents=AGENTS,
    observation_size=OBSERVATION,
    observation_dtype=torch.float32,
    actions=0,
    action_size=ACTION,
)


def small_config(**changes: Any) -> Config:
    """Small networks and minibatches."""
    small = {"f_units": (9, 8), "g_units": 10, "h_units": 11, "actor_units": 6, "batch_size": SIZE}
    return Config(**{**small, **changes})


def make_learner(*configs: Config, seed: int = 1) -> MADDPG:
    """A learner whose targets are other networks than the online ones."""
    learner = MADDPG(configs, TINY)
    learner.initialise(rand(len(configs), learner.init_uniforms, seed=seed))
    for number, half in enumerate((learner.actors, learner.critics)):
        half.target.flat.add_(0.1 * (rand(len(half.target.flat), seed=seed + 1 + number) - 0.5))
    return learner


def make_batch(runs: int = 1, seed: int = 5) -> Batch:
    """Observations and actions in [-1, 1), some true ends."""
    action = 2.0 * rand(runs, SIZE, AGENTS, ACTION, seed=seed + 3) - 1.0
    return Batch(
        obs=2.0 * rand(runs, 2 * SIZE, AGENTS, OBSERVATION, seed=seed) - 1.0,
        action=action,
        reward=5.0 * rand(runs, SIZE, AGENTS, seed=seed + 1),
        discount=(rand(runs, SIZE, seed=seed + 2) < 0.7).float(),
    )


def mask_uniforms(learner: MADDPG, runs: int = 1, seed: int = 9) -> Tensor:
    """What an update takes for its mask, [R, update_uniforms]."""
    return rand(runs, learner.update_uniforms, seed=seed)


def everything(learner: MADDPG, run: int = 0) -> Tensor:
    """All numbers that a run's training goes on from, in one row."""
    return torch.cat([view.flatten() for view in learner.tensors(run).values()])


def torch_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make learners compute in torch."""
    monkeypatch.setattr("msgdrop_cli.kernels.build._loaded", lambda: "not wanted")
