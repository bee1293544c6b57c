"""The loop: who is called when, how often it learns, and that a run depends on itself alone."""

import math
from collections.abc import Callable
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.algorithms.dcc import NAMED, Config
from msgdrop_cli.definition.spec import RunSpec, TrainingSpec
from msgdrop_cli.engine.training import Training
from msgdrop_envs.protocol import Transition
from msgdrop_envs.pursuit import rules as pursuit


def _spec(seed: int = 1, *, games: int = 8, time_limit: int = 30, **changes: Any) -> RunSpec:
    """Pursuit N=6 with the paper's networks; a small memory that learns early and wraps around."""
    early = {"replay_start_env_steps": 64, "replay_capacity": 400, "batch_size": 16}
    return RunSpec(
        environment="pursuit-n6",
        environment_config=pursuit.Config(time_limit=time_limit),
        algorithm="dcc",
        algorithm_config=Config(**{**early, "target_update_every_updates": 7, **changes}),
        training=TrainingSpec(games=games),
        seed=seed,
    )


def _trained(*specs: RunSpec, updates: int) -> Training:
    """Train until so many updates are done."""
    training = Training(specs)
    training.begin()
    while training.learner.progress[0] < updates:
        training.advance()
    return training


def _everything(training: Training, run: int) -> dict[str, Tensor]:
    """All that a run has made: weights, moments, memory, games and sums."""
    replay, learner = training.replay, training.learner
    oldest = max(replay.added - replay.slots + 1, 0)
    state = training.games.state
    return {
        **learner.tensors(run),
        **replay.stretch(run, oldest, replay.added),
        **replay.cut_episodes(run),
        "pursuers": state.pursuers[run],
        "evaders": state.evaders[run],
        "elapsed": training.games.elapsed[run],
        "sums": training.sums[:, run],
    }


def _differences(one: Training, run: int, other: Training, other_run: int) -> list[str]:
    there = _everything(other, other_run)
    here = _everything(one, run).items()
    return [name for name, tensor in here if not torch.equal(tensor, there[name])]


def _recorded_steps(training: Training, monkeypatch: pytest.MonkeyPatch) -> list[Transition]:
    """The transitions that the environment makes from now on."""
    transitions: list[Transition] = []
    step = training.env.step

    def record(*arguments: Any) -> Any:
        state, transition = step(*arguments)
        transitions.append(transition)
        return state, transition

    monkeypatch.setattr(training.env, "step", record)
    return transitions


def _taped(tape: list[str], name: str, call: Callable[..., Any]) -> Callable[..., Any]:
    """The same call, which also writes its name on the tape."""

    def taped(*arguments: Any) -> Any:
        tape.append(name)
        return call(*arguments)

    return taped


# The order of the loop.


def test_loop_is_act_step_store_then_sample_and_update(monkeypatch: pytest.MonkeyPatch) -> None:
    """Algorithm 1's order: 8 games play one step, then learn twice, once for every 4 env steps."""
    training = _trained(_spec(), updates=2)
    tape: list[str] = []
    watched = [
        *((training.learner, name) for name in ("act", "update")),
        *((training.replay, name) for name in ("add", "minibatch")),
        (training.env, "step"),
    ]
    for owner, name in watched:
        monkeypatch.setattr(owner, name, _taped(tape, name, getattr(owner, name)))
    training.advance()
    assert tape == ["act", "step", "add", "minibatch", "update", "minibatch", "update"]


@pytest.mark.parametrize(
    ("games", "every", "start"), [(8, 4, 64), (1, 4, 12), (3, 4, 12), (16, 4, 32), (8, 32, 64)]
)
def test_updates_keep_the_papers_pace(games: int, every: int, start: int) -> None:
    """One update for every 4 (or 32) env steps after the replay start, whatever the games."""
    spec = _spec(games=games, update_every_env_steps=every, replay_start_env_steps=start)
    training = Training([spec])
    training.begin()
    for step in range(1, 30):
        training.advance()
        env_steps = step * games
        assert training.env_steps == env_steps
        expected = max(env_steps // every - start // every, 0)
        assert training.learner.progress[0] == expected


def test_epsilon_follows_the_env_steps_before_the_action(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first action is taken at 0 env steps; all parallel games are counted."""
    training = Training([_spec()])
    training.begin()
    found: list[int] = []
    act = training.learner.act

    def record(obs: Tensor, uniforms: Tensor, env_steps: int, received: Any) -> Tensor:
        found.append(env_steps)
        return act(obs, uniforms, env_steps)

    monkeypatch.setattr(training.learner, "act", record)
    for _ in range(3):
        training.advance()
    assert found == [0, 8, 16]


def test_share_of_random_actions_is_epsilon() -> None:
    """After 1.5e6 of 2e6 env steps 0.265 * 4/5 of the actions differ from the greedy ones."""
    training = Training([_spec()])
    training.begin()
    obs = training.games.obs[:, :1].expand(1, 2_000, 6, -1)
    uniforms = training.streams.uniforms("explore", 2_000, 6, 2)
    actions = training.learner.act(obs, uniforms, 1_500_000)
    share = (actions != training.learner.act_greedily(obs)).float().mean().item()
    expected = 0.265 * 0.8
    assert abs(share - expected) < 5 * math.sqrt(expected * (1 - expected) / 12_000)
    assert torch.equal(actions.unique(), torch.arange(5))


# What is stored and sampled.


def test_memory_holds_what_was_seen_done_and_paid(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each new transition is the games' own; the time limit's next is not the restart's first."""
    training = Training([_spec(1, time_limit=5), _spec(2, time_limit=5)])
    training.begin()
    steps, replay = _recorded_steps(training, monkeypatch), training.replay
    cut = 0
    for _ in range(60):
        before = training.games.obs.clone()
        actions = training.act()
        elapsed = training.games.elapsed + 1
        training.play(actions)
        newest = torch.arange(len(replay) - 8, len(replay)).expand(2, 6, 8)
        drawn = replay.minibatch(replay.rows(newest), training.learner.shown_agents)
        batch = drawn.copied()
        own, after = batch.obs[:, :, 0].view(2, 6, 16, -1).split(8, 2)
        assert torch.equal(own.transpose(1, 2), before)
        assert torch.equal(after.transpose(1, 2), steps[-1].obs)
        assert torch.equal(batch.action.view(2, 6, 8).transpose(1, 2), actions)
        assert torch.equal(batch.reward.view(2, 6, 8).transpose(1, 2), steps[-1].reward)
        assert (batch.discount == 1.0).all()  # nobody catches two evaders in 5 random steps
        cut += int((elapsed == 5).sum())
        assert torch.equal(training.games.elapsed, torch.where(elapsed == 5, 0, elapsed))
    assert cut > 150


def test_minibatches_are_uniform_over_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the oldest to the newest transition, equally often (chi-squared, 5 sigma)."""
    training = _trained(_spec(network="own", batch_size=500), updates=100)
    drawn: list[Tensor] = []
    rows = training.replay.rows

    def record(numbers: Tensor) -> Tensor:
        drawn.append(numbers)
        return rows(numbers)

    monkeypatch.setattr(training.replay, "rows", record)
    for _ in range(10):
        training.sample()
    size = len(training.replay)
    assert size == 400
    counts = torch.cat(drawn).flatten().bincount(minlength=size)
    assert len(counts) == size
    expected = 10 * 6 * 500 / size
    chi_squared = ((counts - expected) ** 2 / expected).sum().item()
    assert abs(chi_squared - size) < 5 * math.sqrt(2 * size)


def test_games_start_spread_over_the_time_limit() -> None:
    """Eight games of 400 steps begin at 0, 50, ... of their time limit, the same in each run."""
    training = Training([_spec(1, time_limit=400), _spec(2, time_limit=400)])
    training.begin()
    assert training.games.elapsed.tolist() == [list(range(0, 400, 50))] * 2
    first = training.games.obs.flatten(2)
    assert len(first.flatten(0, 1).unique(dim=0)) == 16  # every game has a start of its own


def test_window_sums_are_the_transitions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Catches and returns of a window are those of its steps, and the next window starts empty."""
    training = Training([_spec(1), _spec(2)])
    training.begin()
    steps = _recorded_steps(training, monkeypatch)
    for _ in range(60):
        training.play(torch.randint(5, (2, 8, 6), generator=torch.Generator().manual_seed(0)))
    returns = torch.stack([step.reward.sum((1, 2)) for step in steps]).sum(0)
    catches = torch.stack([step.info["catches"].sum(1) for step in steps]).sum(0)
    for run, row in enumerate(training.window(480)):
        assert row["catches_per_500"] == pytest.approx(500 * catches[run].item() / 480)
        assert row["episodes"] == 16.0  # 8 games, 60 steps of 30
        assert row["return_per_episode"] == pytest.approx(returns[run].item() / 16, rel=1e-5)
    assert training.window(480)[0]["return_per_episode"] is None


# What a run depends on.


@pytest.mark.parametrize(
    ("name", "other"),
    [
        *(("dcc", other) for other in ("dcc-md", "dcc-sd", "full-md", "full-sd")),
        ("concat-dcc", "concat-md"),
    ],
)
def test_rate_0_is_simple_dcc_bit_for_bit(name: str, other: str) -> None:
    """300 updates of DCC and of any dropout variant at rate 0 end in equal bits."""
    small = {"g_units": 32, "f_units": (16, 16), "batch_size": 8, "learning_rate": 1e-3}
    short = {"epsilon_final": 0.5, "epsilon_anneal_env_steps": 500}
    plain = _spec(**{**small, **short, **NAMED[name]})
    dropping = _spec(**{**small, **short, **NAMED[other], "rate": 0.0})
    one, two = (_trained(spec, updates=300) for spec in (plain, dropping))
    assert _differences(one, 0, two, 0) == []
    assert one.learner.metrics(0) == two.learner.metrics(0)


def test_a_run_does_not_depend_on_its_cohort() -> None:
    """Three runs of different seeds and rates have equal bits stacked and alone (100 updates)."""
    chances: dict[str, Any] = {"batch_size": 32, "epsilon_start": 0.5, "learning_rate": 1e-3}
    specs = [_spec(s, rate=r, **chances) for s, r in ((1, 0.2), (2, 0.0), (7, 0.5))]
    cohort = _trained(*specs, updates=100)
    alone = [_trained(spec, updates=100) for spec in specs]
    for run, single in enumerate(alone):
        assert _differences(cohort, run, single, 0) == []
    assert cohort.learner.metrics(0) == [single.learner.metrics(0)[0] for single in alone]


def test_seeds_differ_in_weights_games_actions_and_minibatches() -> None:
    """Two seeds share nothing random; the same seed trains twice to the same bits."""
    one, again = _trained(_spec(1), updates=2), _trained(_spec(1), updates=2)
    cohort = Training([_spec(1), _spec(2)])
    cohort.begin()
    assert _differences(one, 0, again, 0) == []
    first, second = (cohort.learner.policy(run) for run in range(2))
    assert all(not torch.equal(first[name], second[name]) for name in first)
    assert not torch.equal(cohort.games.obs[0], cohort.games.obs[1])
    actions = cohort.act()
    assert not torch.equal(actions[0], actions[1])
    for drawn in (cohort.streams.integers("replay", 400, 32), cohort.streams.uniforms("env", 32)):
        assert not torch.equal(drawn[0], drawn[1])


GOLDEN = {
    "dcc-md": (0.0170812, 0.00699984),
    "full-sd": (0.0173110, 0.00689160),
    "fdc": (0.0228518, -0.00827369),
}
"""Loss and Q of the first 30 updates of seed 1."""


@pytest.mark.parametrize("name", GOLDEN)
def test_golden_numbers_of_30_updates(name: str) -> None:
    """Loss and Q stay what they were, on any x86-64, to 1e-4 (all actions random, so no ties)."""
    training = _trained(_spec(**{**NAMED[name], "batch_size": 32}), updates=30)
    row = training.learner.metrics(0)[0]
    assert (row["loss"], row["q"]) == pytest.approx(GOLDEN[name], rel=1e-4)
