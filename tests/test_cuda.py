"""The same training on a GPU.

Where there is none, the CPU takes its place: that shows nothing about rounding, but these tests'
own code does not first run, and fail, on a machine that is lent for some minutes.

Random numbers and pursuit are exact. Whatever rounds agrees within a tolerance, as long as rounding
can change no action: so most runs here play at random (epsilon 1), and learn from that.
"""

import dataclasses
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.graphs import CudaGraphs
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.records.packed import read_log
from msgdrop_cli.records.store import METRICS, POLICY
from msgdrop_envs import autoreset, registry
from tests.chunk_runs import CASES, begun, chunked, counters, everything, small_runs, stepped
from tests.cli_runs import msgdrop
from tests.runs import StopAt, planned
from tests.test_environments import random_actions

HAS_CUDA = torch.cuda.is_available()
DEVICE = "cuda" if HAS_CUDA else "cpu"
needs_cuda = pytest.mark.skipif(not HAS_CUDA, reason="there is no CUDA device")

AT_RANDOM: dict[str, Any] = {"epsilon_final": 1.0, "train_env_steps": 1_600}
"""Actions that do not depend on the weights."""


def _rows(path: Path) -> list[dict[str, float]]:
    """The log, without times."""
    rows: list[dict[str, float]] = read_log(path / METRICS)
    return [{k: v for k, v in row.items() if k != "wall_time_s"} for row in rows]


def _trained(runs: list[PlannedRun], root: Path, device: str = DEVICE) -> list[Path]:
    outcomes = train_cohort(runs, root, device=device)
    assert [outcome.status for outcome in outcomes] == ["done"] * len(runs)
    return [outcome.path for outcome in outcomes]


def _assert_same_curves(one: Path, other: Path, tolerance: float) -> None:
    """What happened in the games is equal; loss and Q are within a tolerance in every row."""
    for here, there in zip(_rows(one), _rows(other), strict=True):
        learnt = {"loss": here.pop("loss"), "q": here.pop("q")}
        expected = {"loss": there.pop("loss"), "q": there.pop("q")}
        assert here == pytest.approx(there, rel=1e-5, nan_ok=True)
        if expected["loss"] is not None:
            assert learnt == pytest.approx(expected, rel=tolerance, abs=1e-4)


def _moved(value: Any, device: str) -> Any:
    """A State, Games or Minibatch on another device; what it lacks (None) it lacks there."""
    if value is None:
        return None
    if isinstance(value, Tensor):
        return value.to(device)
    parts = {f.name: _moved(getattr(value, f.name), device) for f in dataclasses.fields(value)}
    return dataclasses.replace(value, **parts)


def test_random_numbers_are_the_same() -> None:
    """Every stream gives exactly the same numbers on both, drawn or loaded."""
    cpu, gpu = Streams([1, 2], "cpu"), Streams([1, 2], DEVICE)
    for _ in range(3):
        gpu.load("env", 1001)
        assert torch.equal(cpu.uniforms("env", 1001), gpu.uniforms("env", 1001).cpu())
        assert torch.equal(cpu.uniforms("init", 70_001), gpu.uniforms("init", 70_001).cpu())
        below = torch.tensor(12_345, device=DEVICE)
        found = gpu.integers("replay", below, 77).cpu()
        assert torch.equal(cpu.integers("replay", 12_345, 77), found)


@pytest.mark.parametrize("name", sorted(registry.settings()))
def test_games_are_the_same_step_by_step(name: str) -> None:
    """From every state of the CPU: pursuit exactly, numbers within rounding but for edges."""
    config = dataclasses.replace(registry.settings()[name], time_limit=20)
    cpu, gpu = registry.make(config, "cpu"), registry.make(config, DEVICE)
    generator = torch.Generator().manual_seed(1)
    shape = (3, 40)
    elapsed = torch.arange(40).repeat(3, 1) // 2
    games = autoreset.start(
        cpu, torch.rand(*shape, cpu.reset_uniforms, generator=generator), elapsed
    )
    for _ in range(40):
        actions = random_actions(cpu, shape, generator)
        numbers = torch.rand(*shape, cpu.step_uniforms, generator=generator)
        fresh = torch.rand(*shape, cpu.reset_uniforms, generator=generator)
        given = [x.to(DEVICE) for x in (actions, numbers, fresh)]
        there, seen = autoreset.step(gpu, _moved(games, DEVICE), *given)
        games, expected = autoreset.step(cpu, games, actions, numbers, fresh)
        for found, right in (
            (there.obs, games.obs),
            (seen.reward, expected.reward),
            (seen.ended, expected.ended),
        ):
            apart = (found.cpu().double() - right.double()).abs()
            if name.startswith("pursuit"):
                assert apart.max() == 0
            assert (apart > 1e-3).double().mean() < 1e-3


@pytest.mark.parametrize("case", CASES)
def test_an_update_is_the_same(case: str) -> None:
    """One minibatch and one mask give the same gradients, and weights that Adam moves alike."""
    runs = small_runs(**CASES[case])
    cpu, gpu = stepped(runs, 240), begun(runs, DEVICE)
    gpu.learner.resume_at(*cpu.learner.progress)
    for run in (0, 1):
        views = gpu.learner.tensors(run)
        for name, tensor in cpu.learner.tensors(run).items():
            views[name].copy_(tensor)
    drawn = cpu.sample()
    uniforms = cpu.streams.uniforms("dropout", cpu.learner.update_uniforms)
    with torch.no_grad():
        cpu.learner.update(drawn, uniforms)
        gpu.learner.update(_moved(drawn, DEVICE), uniforms.to(DEVICE))
    rate: float = runs[0].spec.algorithm_config.learning_rate
    for name, expected in cpu.learner.tensors(1).items():
        # Adam moves by a gradient's sign at first, which may hang on rounding.
        apart = 1e-5 if "exp_avg" in name else 0.1 * rate
        found = gpu.learner.tensors(1)[name].cpu()
        torch.testing.assert_close(found, expected, rtol=1e-3, atol=apart, msg=name)


@needs_cuda
@pytest.mark.parametrize("case", CASES)
def test_no_step_waits(case: str) -> None:
    """Torch raises if anything in a step makes the host wait for the device."""
    training = stepped(small_runs(**CASES[case]), 240, "cuda")
    torch.cuda.set_sync_debug_mode("error")
    try:
        with torch.no_grad():
            for _ in range(3):
                training.advance()
    finally:
        torch.cuda.set_sync_debug_mode("default")


@needs_cuda
@pytest.mark.parametrize("case", CASES)
def test_a_graph_is_the_steps(case: str) -> None:
    """Captured and launched again and again, a chunk does what its steps do one by one."""
    settings = dict(CASES[case])
    if settings.get("algorithm") != "maddpg-md":
        settings.update(epsilon_start=1.0, epsilon_final=1.0)
    runs = small_runs(**settings)
    env_steps = 100 + 20 * 7 * runs[0].spec.training.games
    expected = stepped(runs, env_steps, "cuda")
    found = chunked(runs, env_steps, CudaGraphs(), "cuda")
    assert counters(found) == counters(expected)
    there = everything(expected)
    for name, tensor in everything(found).items():
        torch.testing.assert_close(tensor, there[name], rtol=1e-3, atol=1e-3, msg=name)


def test_a_cohort_trains_as_on_the_cpu(tmp_path: Path) -> None:
    """The first windows of the log, before rounding can change an action, agree."""
    runs = [planned(seed=1), planned(seed=2, rate=0.5)]
    rows: dict[str, list[dict[str, float]]] = {}
    for place, device in (("here", "cpu"), ("there", DEVICE)):
        paths = _trained(runs, tmp_path / place, device)
        assert len(evaluate(paths[0], channel=Channel.read(0.5), episodes=4, device=device)) == 4
        rows[place] = [_rows(path)[1] for path in paths]
    for cpu, gpu in zip(rows["here"], rows["there"], strict=True):
        assert gpu["loss"] == pytest.approx(cpu["loss"], rel=1e-3)
        assert gpu["q"] == pytest.approx(cpu["q"], rel=1e-3)


def test_learning_curves_are_the_cpus(tmp_path: Path) -> None:
    """Every row of a run that plays at random: the games' metrics equal, loss and Q close."""
    run = planned(**AT_RANDOM)
    [cpu], [gpu] = _trained([run], tmp_path / "here", "cpu"), _trained([run], tmp_path / "there")
    _assert_same_curves(gpu, cpu, 0.05)


def test_a_run_does_not_depend_on_its_cohort(tmp_path: Path) -> None:
    """Stacked with others or alone, a run has the same curves within rounding."""
    runs = [planned(seed=1, rate=r, **AT_RANDOM) for r in (0.0, 0.2, 0.5)]
    together = _trained(runs, tmp_path / "together")
    _assert_same_curves(_trained([runs[1]], tmp_path / "alone")[0], together[1], 0.02)


def test_stopped_and_resumed_is_undisturbed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A checkpoint written on the device goes on there: the same curves and nearly the weights."""
    run = planned(**AT_RANDOM)
    [undisturbed] = _trained([run], tmp_path / "undisturbed")
    with monkeypatch.context() as patch:
        patch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
        [outcome] = train_cohort([run], tmp_path / "stopped", device=DEVICE, stop=StopAt(40))
    assert outcome.status == "interrupted"
    [resumed] = _trained([run], tmp_path / "stopped")
    _assert_same_curves(resumed, undisturbed, 0.01)
    assert (resumed / POLICY).stat().st_size == (undisturbed / POLICY).stat().st_size


def test_a_worker_trains_on_the_device(tmp_path: Path) -> None:
    """The command line gives a cohort to a joblib worker, which trains and evaluates it."""
    small = {
        "training.train_env_steps": 400,
        "algorithm.replay_start_env_steps": 100,
        "algorithm.replay_capacity": 200,
        "environment.time_limit": 40,
    }
    settings = [part for k, v in small.items() for part in ("--set", f"{k}={v}")]
    where = ("--results", tmp_path, "--device", DEVICE, "--workers", "1")
    said = msgdrop("train", "--seeds", "2", *where, *settings)
    assert said.code == 0, said.err
    assert len(list(tmp_path.rglob(POLICY))) == 2
