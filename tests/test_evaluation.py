"""Greedy episodes: whole, repeatable, apart from training, with links broken as asked."""

import shutil
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.algorithms.dcc import DCC
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.engine import evaluation
from msgdrop_cli.engine.evaluation import evaluate, evaluate_run
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.engine.playing import play_episodes
from msgdrop_cli.engine.policy import read_trained
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.scene import kind_in
from msgdrop_cli.engine.tensors import read_tensors, write_tensors
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.messages.received import Received
from msgdrop_cli.records.files import Epoch, run_lock
from msgdrop_cli.records.store import list_runs
from msgdrop_envs import autoreset, registry
from tests.dcc_samples import integers, rand
from tests.runs import digest, planned


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Run folders of two policies that have learnt next to nothing, which is enough here."""
    root = tmp_path_factory.mktemp("results")
    return {
        name: train_cohort([planned(name, train_env_steps=160)], root)[0].path
        for name in ("dcc-md", "fdc")
    }


def test_every_episode_is_played_whole_and_once(tmp_path: Path) -> None:
    """As many rows as asked for, each with steps up to the limit, catches up to the evaders."""
    [outcome] = train_cohort([planned("fdc", map_size=3, train_env_steps=160)], tmp_path)
    rows = evaluate(outcome.path, channel=Channel.read(0.0), episodes=400)
    assert [row["episode"] for row in rows] == list(range(400))
    assert {row["catches"] for row in rows} == {0, 1, 2}
    assert len({row["steps"] for row in rows}) > 5
    for row in rows:
        assert 1 <= row["steps"] <= 60
        assert row["finished"] == (row["catches"] == 2)
        assert row["finished"] or row["steps"] == 60
        floor = -0.05 * 6 * row["steps"] - 0.5 * row["edge_hits"]
        assert row["return"] >= floor - 1e-3
        assert (row["return"] > floor + 1) == (row["catches"] > 0)


def test_a_position_is_counted_at_the_end_only(tmp_path: Path) -> None:
    """Of 8 landmarks of navigation at most 8 are covered, however long the episode."""
    run = planned("fdc", environment="navigation-n8", time_limit=25, train_env_steps=160)
    [outcome] = train_cohort([run], tmp_path)
    rows = evaluate(outcome.path, channel=Channel.read(0.0), episodes=200)
    assert {row["steps"] for row in rows} == {25}
    assert not any(row["finished"] for row in rows)
    assert 1 <= max(row["covered"] for row in rows) <= 8
    assert max(row["collisions"] for row in rows) > 8
    for row in rows:
        assert row["return"] <= -4 * row["collisions"]


def test_evaluation_repeats_itself(trained: dict[str, Path]) -> None:
    """The same policy and channel give the same rows."""
    first, second = (
        evaluate(trained["dcc-md"], channel=Channel.read(0.5), episodes=20) for _ in range(2)
    )
    assert first == second


def test_broken_links_change_what_a_policy_does(trained: dict[str, Path]) -> None:
    """DCC-MD listens: none, half and all broken are three results."""
    results = [
        [
            row["edge_hits"]
            for row in evaluate(trained["dcc-md"], channel=Channel.read(b), episodes=30)
        ]
        for b in (0.0, 0.5, 1.0)
    ]
    assert results[0] != results[1] != results[2] != results[0]


def test_share_of_random_actions_in_evaluation_is_epsilon(
    trained: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """4 of 5 random choices are another action than the greedy one (5 sigma); none is at 0."""
    taken = list[Tensor]()

    def watched(env: Any, act: Any, *rest: Any) -> Tensor | None:
        learner = read_trained(trained["fdc"]).learner

        def both(games: autoreset.Games, playing: Tensor) -> Tensor:
            actions: Tensor = act(games, playing)
            taken.append((actions != learner.act_greedily(games.obs)).flatten())
            return actions

        return play_episodes(env, both, *rest)

    monkeypatch.setattr(evaluation, "play_episodes", watched)
    for text, share in (("half", 0.0), ("half+epsilon:0.1", 0.08)):
        taken.clear()
        evaluate(trained["fdc"], channel=Channel.read(text), episodes=30)
        differ = torch.cat(taken).float()
        assert abs(differ.mean() - share) <= 5 * (share * (1 - share) / len(differ)) ** 0.5


def test_policies_explore_alike_through_every_channel(trained: dict[str, Path]) -> None:
    """FDC's rows are the same whatever breaks, other ones than the greedy, and the same again."""
    rows = [
        [list(row.values())[1:] for row in evaluate(trained["fdc"], channel=each, episodes=30)]
        for each in map(Channel.read, ("none", *("none+epsilon:0.1", "half+epsilon:0.1") * 2))
    ]
    assert rows[1] == rows[2] == rows[3] == rows[4] != rows[0]


def test_epsilon_needs_a_choice_of_actions() -> None:
    """Numbers are refused, by what would be played through it."""
    env = registry.make("waterworld-n8")
    with pytest.raises(DefinitionError, match="epsilon is for agents that have a choice"):
        kind_in(Channel.read("none+epsilon:0.1"), env, "here")


def test_fdc_does_not_notice_broken_links(trained: dict[str, Path]) -> None:
    """Row by row the same episodes, whatever breaks (paper l. 525)."""
    none, all_broken = (
        evaluate(trained["fdc"], channel=Channel.read(b), episodes=30) for b in (0.0, 1.0)
    )
    assert [row | {"broken_links": 0.0} for row in all_broken] == none


def test_broken_links_are_zero_messages() -> None:
    """A message over a broken link has no influence; one that arrives is scaled as ever."""
    known = catalogue()
    named = known.algorithm("dcc-md")
    env = registry.make(known.environment("pursuit-n6"))
    learner = DCC([named.config_class(rate=0.3)], env)
    learner.initialise(rand(1, learner.init_uniforms, seed=1))
    obs = integers(3, 1, 4, 6, 147, seed=2).to(torch.uint8)
    keep = torch.ones(1, 4, 6, 5)
    keep[:, :, 2, 3] = 0.0  # agent 2 does not hear its fourth sender, agent 4
    muted = obs.clone()
    muted[:, :, 4] = 0
    q = learner.q_exec(obs, Received(keep))
    torch.testing.assert_close(q[:, :, 2], learner.q_exec(muted)[:, :, 2])
    torch.testing.assert_close(q[:, :, [0, 1, 3, 5]], learner.q_exec(obs)[:, :, [0, 1, 3, 5]])
    assert not torch.allclose(q[:, :, 2], learner.q_exec(obs)[:, :, 2])


def test_evaluating_does_not_change_training(
    trained: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between two steps, and between stop and resume, evaluations of the same seed leave no trace.

    A stopped run has no policy yet, so one is put into a copy of its folder.
    """
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
    run, calls = planned(), 0
    [undisturbed] = train_cohort([run], tmp_path / "undisturbed")

    def stop_after_evaluations() -> bool:
        nonlocal calls
        calls += 1
        if calls % 10 == 0:
            evaluate(trained["dcc-md"], channel=Channel.read(0.5), episodes=5)
        return calls == 30  # of 60 steps: while it learns

    [stopped] = train_cohort([run], tmp_path / "disturbed", stop=stop_after_evaluations)
    assert (stopped.status, stopped.env_steps) == ("interrupted", 240)
    copy = tmp_path / "copy"
    shutil.copytree(stopped.path, copy)
    shutil.copy(undisturbed.path / "policy.safetensors", copy)
    assert evaluate_run(copy, channel=Channel.read(0.5), episodes=10) == 10
    [resumed] = train_cohort([run], tmp_path / "disturbed")
    assert resumed.status == "done"
    assert digest(resumed.path) == digest(undisturbed.path)


def test_enough_episodes_are_not_played_again(tmp_path: Path) -> None:
    """Of less than a block more are drawn anew, fewer do nothing, other channels stay."""
    [outcome] = train_cohort([planned(train_env_steps=160)], tmp_path)
    assert evaluate_run(outcome.path, channel=Channel.read(0.5), episodes=8) == 8
    assert evaluate_run(outcome.path, channel=Channel.read(0.0), episodes=10) == 10
    assert evaluate_run(outcome.path, channel=Channel.read(0.0), episodes=6) == 0
    assert evaluate_run(outcome.path, channel=Channel.read(0.0), episodes=12) == 12
    [record] = list_runs(outcome.path)
    assert len(record.episodes()[Channel.read(0.0)]) == 12
    assert len(record.episodes()[Channel.read(0.5)]) == 8


@pytest.mark.parametrize("text", ["none", "half", "noise:0.5", "worst:3"])
def test_more_episodes_leave_the_blocks_before_as_they_are(
    tmp_path: Path, trained: dict[str, Path], monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    """Four, then seven, then ten are the ten of one go, and only what is missing is played."""
    monkeypatch.setattr(evaluation, "BLOCK", 4)
    channel, copy = Channel.read(text), tmp_path / "copy"
    shutil.copytree(trained["dcc-md"], copy)
    at_once = evaluate(trained["dcc-md"], channel=channel, episodes=10)
    played = [evaluate_run(copy, channel=channel, episodes=count) for count in (4, 7, 10)]
    assert played == [4, 3, 6]
    assert list_runs(copy)[0].episodes()[channel] == at_once
    assert at_once[:4] == evaluate(trained["dcc-md"], channel=channel, episodes=4)
    assert [row["episode"] for row in at_once] == list(range(10))
    games = [(row["steps"], row["return"], row["edge_hits"]) for row in at_once]
    assert games[:4] != games[4:8]


def test_channels_meet_the_same_games_however_few_are_asked_for(tmp_path: Path) -> None:
    """A deaf policy does the same in each episode of two channels; five and two were asked for."""
    [outcome] = train_cohort([planned("fdc", map_size=3, train_env_steps=160)], tmp_path)
    none, some = Channel.read(0.0), Channel.read(0.3)
    assert evaluate_run(outcome.path, channel=none, episodes=5) == 5
    assert evaluate_run(outcome.path, channel=some, episodes=2) == 5
    played = list_runs(outcome.path)[0].episodes()
    without = [[{**row, "broken_links": 0} for row in played[each]] for each in (none, some)]
    assert without[0] == without[1]


def test_a_stopped_evaluation_writes_nothing(tmp_path: Path) -> None:
    """All rows of a channel or none."""
    [outcome] = train_cohort([planned(train_env_steps=160, time_limit=5_000)], tmp_path)
    done = evaluate_run(outcome.path, channel=Channel.read(0.0), episodes=300, stop=lambda: True)
    assert done == 0
    assert not (outcome.path / "episodes.jsonl").exists()


def test_another_runs_policy_is_refused(trained: dict[str, Path], tmp_path: Path) -> None:
    """A policy that does not fit the record is one clear line, not a crash."""
    [outcome] = train_cohort([replace(planned(train_env_steps=160))], tmp_path)
    content = (trained["fdc"] / "policy.safetensors").read_bytes()
    (outcome.path / "policy.safetensors").write_bytes(content)
    with pytest.raises(RecordError, match="does not fit this run"):
        evaluate(outcome.path, channel=Channel.read(0.0), episodes=2)


def test_a_damaged_policy_is_refused(tmp_path: Path) -> None:
    """A cut file is a RecordError that names it."""
    [outcome] = train_cohort([planned(train_env_steps=160)], tmp_path)
    policy = outcome.path / "policy.safetensors"
    policy.write_bytes(policy.read_bytes()[:-100])
    with pytest.raises(RecordError, match=r"policy\.safetensors: is damaged"):
        evaluate(outcome.path, channel=Channel.read(0.0), episodes=2)


def test_weights_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    """A policy of NaN would act, and mean nothing."""
    [outcome] = train_cohort([planned(train_env_steps=160)], tmp_path)
    policy = outcome.path / "policy.safetensors"
    tensors = read_tensors(policy)
    tensors["h2.bias"][0] = float("nan")
    write_tensors(policy, tensors)
    with pytest.raises(RecordError, match="not finite"):
        evaluate(outcome.path, channel=Channel.read(0.0), episodes=2)


def test_one_process_evaluates_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other one would overwrite its rows; what was played meanwhile is not played again."""
    [outcome] = train_cohort([planned(train_env_steps=160)], tmp_path)
    with run_lock(outcome.path), pytest.raises(RecordError) as caught:
        evaluate_run(outcome.path, channel=Channel.read(0.5), episodes=8)
    assert caught.value.exit_code == 75

    def late_lock(path: Path) -> AbstractContextManager[Epoch]:
        monkeypatch.setattr(evaluation, "run_lock", run_lock)
        assert evaluate_run(path, channel=Channel.read(0.5), episodes=8) == 8
        return run_lock(path)

    monkeypatch.setattr(evaluation, "run_lock", late_lock)
    assert evaluate_run(outcome.path, channel=Channel.read(0.5), episodes=8) == 0
    assert evaluate_run(outcome.path, channel=Channel.read(0.5), episodes=8) == 0
