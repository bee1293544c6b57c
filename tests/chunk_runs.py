"""Small cohorts of every kind, trained step by step or by chunks (engine/graphs.py)."""

from dataclasses import fields, replace
from typing import Any

import torch
from torch import Tensor

from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine.graphs import Chunks, Recorder
from msgdrop_cli.engine.training import Training
from tests.dcc_samples import rand
from tests.runs import planned

CASES: dict[str, dict[str, Any]] = {
    "pursuit": {"rate": 0.5},
    "pursuit, one game": {"games": 1, "replay_capacity": 40},
    "pursuit, three games, clipped": {"games": 3, "max_gradient_norm": 0.1},
    "pursuit, elements": {"algorithm": "full-sd"},
    "pursuit, own": {"algorithm": "fdc"},
    "pursuit, concatenated": {"algorithm": "concat-md", "epsilon_anneal_env_steps": 0},
    "pursuit, compressed": {"encoder": "autoencoder"},
    "navigation": {"environment": "navigation-n8", "time_limit": 7},
    "waterworld": {
        "algorithm": "maddpg-md",
        "environment": "waterworld-n8",
        "replay_start_env_steps": 80,
        "update_every_env_steps": 8,
        "actor_update_every_env_steps": 24,
        "batch_size": 8,
    },
}
"""What is trained; all wrap their memory round, meet time limits and end episodes in chunks."""
SMALL = {"f_units": (16, 8), "g_units": 24, "batch_size": 4, "target_update_every_updates": 7}
STEPS = 5
"""In a chunk."""


def small_runs(algorithm: str = "dcc-md", games: int = 8, **settings: Any) -> list[PlannedRun]:
    """Two seeds with short games, small networks and little memory."""
    small = {"time_limit": 11, "epsilon_start": 0.6, "epsilon_anneal_env_steps": 400, **SMALL}
    if algorithm == "maddpg-md":
        small = {"time_limit": 11}
    runs = [planned(algorithm, seed=seed, **{**small, **settings}) for seed in (1, 2)]
    training = replace(runs[0].spec.training, games=games)
    return [replace(run, spec=replace(run.spec, training=training)) for run in runs]


def begun(runs: list[PlannedRun], device: str = "cpu") -> Training:
    """A training that has begun."""
    training = Training([run.spec for run in runs], device)
    encoder = training.learner.encoding.tensors(0).items()
    training.begin({name: rand(*part.shape, seed=1) - 0.5 for name, part in encoder})
    return training


def everything(training: Training) -> dict[str, Tensor]:
    """All tensors that a training goes on from; what nobody needs (the last row) left out."""
    replay, games = training.replay, training.games
    state = {field.name: getattr(games.state, field.name) for field in fields(games.state)}
    learner = {f"{r}.{k}": v for r in (0, 1) for k, v in training.learner.tensors(r).items()}
    rings = ("action", "reward", "discount", "next_row")
    memory = {"seen": replay.obs[:, :-1], **{name: getattr(replay, name) for name in rings}}
    if replay.messages is not None:
        memory["said"] = replay.messages[:, :-1]
    return {
        **{**state, **learner, **memory},
        **{"elapsed": games.elapsed, "obs": games.obs, "sums": training.sums},
    }


def counters(training: Training) -> tuple[Any, ...]:
    """All that the host counts."""
    learner, replay = training.learner, training.replay
    return (
        training.env_steps,
        replay.added,
        len(replay),
        learner.progress,
        training.streams.positions,
    )


@torch.no_grad()
def stepped(runs: list[PlannedRun], env_steps: int, device: str = "cpu") -> Training:
    """Trained step by step."""
    training = begun(runs, device)
    while training.env_steps < env_steps:
        training.advance()
    return training


@torch.no_grad()
def chunked(
    runs: list[PlannedRun], env_steps: int, recorder: Recorder, device: str = "cpu"
) -> Training:
    """Trained by chunks."""
    training = begun(runs, device)
    chunks = Chunks(training, recorder, STEPS)
    while training.env_steps < env_steps:
        chunks.advance(-(-(env_steps - training.env_steps) // training.games_each))
    return training
