"""Chunks of steps that are recorded and repeated are the steps themselves, bit for bit.

There may be no GPU here, so a tape stands for a CUDA graph (tests/tape.py): it is as blind to what
the host counts, and sees every operator for which a GPU would have to wait.
"""

from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine.graphs import Chunks
from msgdrop_cli.engine.replay import Replay
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.training import Training
from tests.runs import StopAt, digest, planned
from tests.tape import Tapes, be_a_device

CASES: dict[str, dict[str, Any]] = {
    "pursuit": {"rate": 0.5},
    "pursuit, one game": {"games": 1, "replay_capacity": 40},
    "pursuit, three games, clipped": {"games": 3, "max_gradient_norm": 0.1},
    "pursuit, elements": {"algorithm": "full-sd"},
    "pursuit, own": {"algorithm": "fdc"},
    "pursuit, concatenated": {"algorithm": "concat-md", "epsilon_anneal_env_steps": 0},
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


@pytest.fixture(autouse=True)
def _no_c_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msgdrop_cli.networks.inputs.kernel", lambda: None)


def _runs(algorithm: str = "dcc-md", games: int = 8, **settings: Any) -> list[PlannedRun]:
    """Two seeds with short games, small networks and little memory."""
    small = {"time_limit": 11, "epsilon_start": 0.6, "epsilon_anneal_env_steps": 400, **SMALL}
    if algorithm == "maddpg-md":
        small = {"time_limit": 11}
    runs = [planned(algorithm, seed=seed, **{**small, **settings}) for seed in (1, 2)]
    training = replace(runs[0].spec.training, games=games)
    return [replace(run, spec=replace(run.spec, training=training)) for run in runs]


def _begun(runs: list[PlannedRun]) -> Training:
    training = Training([run.spec for run in runs])
    training.begin()
    return training


def _everything(training: Training) -> dict[str, Tensor]:
    """All tensors that a training goes on from; what nobody needs (the last row) left out."""
    replay, games = training.replay, training.games
    state = {field.name: getattr(games.state, field.name) for field in fields(games.state)}
    learner = {f"{r}.{k}": v for r in (0, 1) for k, v in training.learner.tensors(r).items()}
    rings = ("action", "reward", "discount", "next_row")
    memory = {"seen": replay.obs[:, :-1], **{name: getattr(replay, name) for name in rings}}
    return {
        **{**state, **learner, **memory},
        **{"elapsed": games.elapsed, "obs": games.obs, "sums": training.sums},
    }


def _counters(training: Training) -> tuple[Any, ...]:
    learner, replay = training.learner, training.replay
    return (
        training.env_steps,
        replay.added,
        len(replay),
        learner.progress,
        training.streams.positions,
    )


@torch.no_grad()
def _stepped(runs: list[PlannedRun], env_steps: int) -> Training:
    training = _begun(runs)
    while training.env_steps < env_steps:
        training.advance()
    return training


@torch.no_grad()
def _chunked(runs: list[PlannedRun], env_steps: int, tapes: Tapes) -> Training:
    training = _begun(runs)
    chunks = Chunks(training, tapes, STEPS)
    while training.env_steps < env_steps:
        chunks.advance(-(-(env_steps - training.env_steps) // training.games_each))
    return training


@pytest.mark.parametrize("case", CASES)
def test_chunks_are_the_steps(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Weights, moments, memory, games, sums, counters and positions end in equal bits."""
    runs = _runs(**CASES[case])
    env_steps = 100 + 40 * 7 * runs[0].spec.training.games
    expected, tapes = _stepped(runs, env_steps), Tapes()
    be_a_device(monkeypatch)
    found = _chunked(runs, env_steps, tapes)
    there = _everything(expected)
    different = [k for k, v in _everything(found).items() if not torch.equal(v, there[k])]
    assert different == []
    assert _counters(found) == _counters(expected)
    assert found.learner.metrics(env_steps) == expected.learner.metrics(env_steps)
    assert tapes.repeated > 10
    assert found.replay.added > found.replay.slots


@pytest.mark.parametrize("case", CASES)
def test_nothing_is_asked_within_a_chunk(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """No operator is recorded for which the host would have to wait for a GPU."""
    be_a_device(monkeypatch)
    runs, tapes = _runs(**CASES[case]), Tapes()
    _chunked(runs, 100 + 50 * runs[0].spec.training.games, tapes)
    assert tapes.tapes
    assert {name for tape in tapes.tapes for name in tape.waiting()} == set()


@pytest.mark.parametrize(("case", "env_steps"), [("pursuit", 424), ("waterworld", 240)])
def test_a_question_is_noticed(case: str, env_steps: int) -> None:
    """The check above fires on what the CPU asks in passing."""
    runs, tapes = _runs(**CASES[case]), Tapes()
    _chunked(runs, env_steps, tapes)
    assert "aten._local_scalar_dense.default" in tapes.tapes[0].waiting()
    if case == "waterworld":
        assert "aten.nonzero.default" in tapes.tapes[0].waiting()


def test_a_counter_that_is_baked_in_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tape repeats the host's numbers as a graph would: drawing by `len` falls behind."""
    runs = _runs(replay_capacity=10_000)
    expected = _stepped(runs, 700)
    monkeypatch.setattr(Replay, "held", property(len))
    found = _chunked(runs, 700, Tapes())
    assert not torch.equal(
        found.learner.tensors(0)["online.h2.weight"],
        expected.learner.tensors(0)["online.h2.weight"],
    )


@pytest.mark.parametrize(("every", "recordings"), [(10, 1), (20, 2), (7, 7), (1_000, 1)])
def test_a_recording_for_each_pattern(
    every: int, recordings: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Chunks of 10 updates differ by where the target is copied: at most as many are recorded."""
    be_a_device(monkeypatch)
    tapes = Tapes()
    _chunked(_runs(target_update_every_updates=every), 104 + 40 * 16, tapes)
    assert len(tapes.tapes) == recordings


def test_steps_alone_before_learning_and_before_a_stop() -> None:
    """Chunks begin with learning and never pass by what the caller stops for."""
    training = _begun(_runs(replay_start_env_steps=80))
    chunks, found = Chunks(training, Tapes(), STEPS), []
    with torch.no_grad():
        for most in (9, *[9] * 9, 4, 5, 6):
            before = training.env_steps
            chunks.advance(most)
            found.append((training.env_steps - before) // 8)
    assert found == [*[1] * 10, 1, 5, 5]


def test_without_a_recorder_a_step_is_a_step() -> None:
    """On the CPU nothing is recorded."""
    training = _begun(_runs(replay_start_env_steps=0))
    with torch.no_grad():
        Chunks(training, None, STEPS).advance(100)
    assert training.env_steps == 8


# Whole runs.


def _trained(runs: list[PlannedRun], root: Path) -> list[str]:
    outcomes = train_cohort(runs, root)
    assert [outcome.status for outcome in outcomes] == ["done", "done"]
    return [digest(outcome.path) for outcome in outcomes]


def _record_runs(monkeypatch: pytest.MonkeyPatch) -> Tapes:
    """Make `train_cohort` record and repeat."""
    tapes = Tapes()
    be_a_device(monkeypatch)
    monkeypatch.setattr("msgdrop_cli.engine.run.recorder", lambda device: tapes)
    monkeypatch.setattr("msgdrop_cli.engine.run.Chunks", partial(Chunks, steps=STEPS))
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
    return tapes


def test_a_chunked_run_logs_and_ends_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Policy and every row of the log are what they are step by step."""
    runs = _runs(target_update_every_updates=10)
    expected = _trained(runs, tmp_path / "steps")
    tapes = _record_runs(monkeypatch)
    assert _trained(runs, tmp_path / "chunks") == expected
    assert tapes.repeated > 3


def test_a_chunked_run_resumes_to_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopped between two chunks, and gone on step by step from the checkpoint."""
    runs = _runs(target_update_every_updates=10)
    expected = _trained(runs, tmp_path / "steps")
    with monkeypatch.context() as patch:
        tapes = _record_runs(patch)
        outcomes = train_cohort(runs, tmp_path / "chunks", stop=StopAt(20))
    assert [outcome.status for outcome in outcomes] == ["interrupted"] * 2
    assert 100 < outcomes[0].env_steps < 480
    assert tapes.repeated
    assert _trained(runs, tmp_path / "chunks") == expected
