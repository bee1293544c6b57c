"""Chunks of steps that are recorded and repeated are the steps themselves, bit for bit.

There may be no GPU here, so a tape stands for a CUDA graph (tests/tape.py): it is as blind to what
the host counts, and sees every operator for which a GPU would have to wait.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import pytest
import torch

from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine.graphs import Chunks, CudaGraphs
from msgdrop_cli.engine.replay import Replay
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.training import Training
from tests.chunk_runs import CASES, STEPS, begun, chunked, counters, everything, small_runs, stepped
from tests.runs import StopAt, digest
from tests.tape import Tapes, be_a_device, without_c


@pytest.fixture(autouse=True)
def _no_c_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    without_c(monkeypatch)


class Both(NamedTuple):
    """The same cohort trained step by step and by chunks, and what was recorded."""

    steps: Training
    chunks: Training
    tapes: Tapes


@pytest.fixture(scope="module", params=CASES)
def both(request: pytest.FixtureRequest) -> Both:
    """Every case, for as many steps as make many repetitions and wrap the memory round."""
    runs, tapes = small_runs(**CASES[request.param]), Tapes()
    env_steps = 100 + 40 * 7 * runs[0].spec.training.games
    with pytest.MonkeyPatch.context() as patch:
        without_c(patch)
        steps = stepped(runs, env_steps)
        be_a_device(patch)
        return Both(steps, chunked(runs, env_steps, tapes), tapes)


def test_chunks_are_the_steps(both: Both) -> None:
    """Weights, moments, memory, games and sums end in equal bits."""
    there = everything(both.steps)
    found = everything(both.chunks).items()
    assert [name for name, tensor in found if not torch.equal(tensor, there[name])] == []
    assert both.tapes.repeated > 10
    assert both.chunks.replay.added > both.chunks.replay.slots


def test_chunks_are_counted_as_the_steps(both: Both) -> None:
    """Env steps, memory, updates and positions of the random numbers, in the host's numbers."""
    assert counters(both.chunks) == counters(both.steps)


def test_nothing_is_asked_within_a_chunk(both: Both) -> None:
    """No operator is recorded for which the host would have to wait for a GPU."""
    assert both.tapes.tapes
    assert {name for tape in both.tapes.tapes for name in tape.waiting()} == set()


LAUNCHES = {
    "pursuit": 402,
    "pursuit, one game": 200,
    "pursuit, three games, clipped": 285,
    "pursuit, elements": 402,
    "pursuit, own": 375,
    "pursuit, concatenated": 385,
    "pursuit, compressed": 410,
    "navigation": 390,
    "waterworld": 655,
}
"""Operators of a step with its updates, at most: telling a GPU costs more than doing."""


def test_a_step_takes_no_more_operators(both: Both, request: pytest.FixtureRequest) -> None:
    """A count that no busy machine can change."""
    counts = [tape.launches() / STEPS for tape in both.tapes.tapes]
    assert max(counts) <= LAUNCHES[request.node.callspec.params["both"]]


@pytest.mark.parametrize(("case", "env_steps"), [("pursuit", 424), ("waterworld", 240)])
def test_a_question_is_noticed(case: str, env_steps: int) -> None:
    """The check above fires on what the CPU asks in passing."""
    runs, tapes = small_runs(**CASES[case]), Tapes()
    chunked(runs, env_steps, tapes)
    assert "aten._local_scalar_dense.default" in tapes.tapes[0].waiting()
    if case == "waterworld":
        assert "aten.nonzero.default" in tapes.tapes[0].waiting()


def test_a_counter_that_is_baked_in_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tape repeats the host's numbers as a graph would: drawing by `len` falls behind."""
    runs = small_runs(replay_capacity=10_000)
    expected = stepped(runs, 700)
    monkeypatch.setattr(Replay, "held", property(len))
    found = chunked(runs, 700, Tapes())
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
    chunked(small_runs(target_update_every_updates=every), 104 + 40 * 16, tapes)
    assert len(tapes.tapes) == recordings


def test_steps_alone_before_learning_and_before_a_stop() -> None:
    """Chunks begin with learning and never pass by what the caller stops for."""
    training = begun(small_runs(replay_start_env_steps=80))
    chunks, found = Chunks(training, Tapes(), STEPS), []
    with torch.no_grad():
        for most in (9, *[9] * 9, 4, 5, 6):
            before = training.env_steps
            chunks.advance(most)
            found.append((training.env_steps - before) // 8)
    assert found == [*[1] * 10, 1, 5, 5]


def test_without_a_recorder_a_step_is_a_step() -> None:
    """On the CPU nothing is recorded."""
    training = begun(small_runs(replay_start_env_steps=0))
    with torch.no_grad():
        Chunks(training, None, STEPS).advance(100)
    assert training.env_steps == 8


def test_the_host_is_one_launch_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    """Captured once into the shared pool; what a launch made is waited for after the next one."""
    said: list[str] = []

    class Event:
        def __init__(self, blocking: bool) -> None:
            self.number = sum(word.startswith("mark") for word in said)

        def record(self) -> None:
            said.append(f"mark {self.number}")

        def synchronize(self) -> None:
            said.append(f"wait {self.number}")

    @contextmanager
    def capture(graph: object, pool: str, capture_error_mode: str) -> Iterator[None]:
        said.append(f"capture into {pool}")
        yield

    graph = SimpleNamespace(replay=lambda: said.append("launch"))
    for name, fake in {
        "graph_pool_handle": lambda: "pool",
        "CUDAGraph": lambda: graph,
        "graph": capture,
        "Event": Event,
    }.items():
        monkeypatch.setattr(torch.cuda, name, fake)
    graphs = CudaGraphs()
    again = graphs.record(lambda: said.append("body"))
    chunks = Chunks(begun(small_runs()), None)
    for _ in range(3):
        again()
        chunks._look(graphs)
    assert said[:2] == ["capture into pool", "body"]
    launches = ["launch", "mark 0", "launch", "mark 1", "wait 0", "launch", "mark 2", "wait 1"]
    assert said[2:] == launches


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
    runs = small_runs(target_update_every_updates=10)
    expected = _trained(runs, tmp_path / "steps")
    tapes = _record_runs(monkeypatch)
    assert _trained(runs, tmp_path / "chunks") == expected
    assert tapes.repeated > 3


def test_a_chunked_run_resumes_to_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopped between two chunks, and gone on step by step from the checkpoint."""
    runs = small_runs(target_update_every_updates=10)
    expected = _trained(runs, tmp_path / "steps")
    with monkeypatch.context() as patch:
        tapes = _record_runs(patch)
        outcomes = train_cohort(runs, tmp_path / "chunks", stop=StopAt(20))
    assert [outcome.status for outcome in outcomes] == ["interrupted"] * 2
    assert 100 < outcomes[0].env_steps < 480
    assert tapes.repeated
    assert _trained(runs, tmp_path / "chunks") == expected
