"""Training through a channel: what is lost is neither heard nor learnt from."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from msgdrop_cli.channels import others
from msgdrop_cli.definition.spec import PlannedRun, TrainingSpec
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.tensors import read_tensors
from msgdrop_cli.engine.training import Training
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.store import POLICY
from msgdrop_envs import autoreset
from tests.cli_runs import msgdrop
from tests.dcc_samples import use_kernel
from tests.runs import StopAt, planned

CHANNELS = ("loss:0.3", "half", "links-step:0.5", "bursts:0.3,3", "one-way:0.5", "silent:2")
WHOLE_EPISODES = ("half", "one-way:0.5", "silent:2")
NEAR = ("within:4", "nearest:2", "distance:9")


def through(channel: str, algorithm: str = "dcc-md", **settings: Any) -> PlannedRun:
    """A tiny run that trains through a channel."""
    run = planned(algorithm, **{"train_env_steps": 400, "time_limit": 11, **settings})
    return replace(
        run, spec=replace(run.spec, training=replace(run.spec.training, channel=channel))
    )


def trained(run: PlannedRun, steps: int) -> Training:
    """After so many steps of every game."""
    training = Training([run.spec])
    training.begin()
    with torch.no_grad():
        for _ in range(steps):
            training.advance()
    return training


@pytest.mark.parametrize("channel", [*CHANNELS, *NEAR])
def test_what_arrives_is_stored_where_it_was_seen(channel: str) -> None:
    """Row by row of the memory: the arrivals that the agents acted by, and those of ends."""
    run = through(channel, replay_start_env_steps=10_000, replay_capacity=10_000)
    training = Training([run.spec])
    training.begin()
    acted = []
    for _ in range(30):
        assert training.lost is not None
        acted.append(training.lost.arrives.clone())
        training.advance()
    replay, games = training.replay, training.games_each
    assert replay.arrives is not None
    for step, arrives in enumerate(acted):
        assert torch.equal(replay.arrives[:, step * games : (step + 1) * games], arrives)
    seen = torch.stack(acted).float()
    assert 0 < seen.mean() < 1
    ends = replay.next_row[0, : 29 * games] >= replay.slots * games
    assert ends.any()
    cut = replay.arrives[0, replay.next_row[0, : 29 * games][ends].long()]
    assert 0 < cut.float().mean() < 1
    if channel in WHOLE_EPISODES:  # an end belongs to the episode that ends
        assert torch.equal(cut, replay.arrives[0, : 29 * games][ends])


def test_nearest_are_the_nearest() -> None:
    """Of the games as they stand."""
    training = trained(through("nearest:2"), 20)
    assert training.lost is not None
    where = training.env.places(training.games.state)[0]  # type: ignore[attr-defined]
    apart = (where[:, others(6)] - where[:, :, None]).norm(dim=-1)  # [E, N, S]
    for game in range(training.games_each):
        for agent in range(6):
            ranked = sorted((apart[game, agent, slot].item(), slot) for slot in range(5))
            heard = [s for s in range(5) if training.lost.arrives[0, game, agent, s]]
            assert heard == sorted(slot for _, slot in ranked[:2])


@pytest.mark.parametrize("kernel", ["torch", ""])
@pytest.mark.parametrize("algorithm", ["dcc-md", "full-sd", "concat-md"])
def test_lost_messages_are_not_learnt_from(
    algorithm: str, kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An update does not depend on what was lost, now or next; on what arrived it does."""
    use_kernel(kernel, monkeypatch)
    results = []
    for changes in ("nothing", "what was lost", "what arrived"):
        training = trained(through("loss:0.5", algorithm, replay_start_env_steps=10_000), 40)
        replay = training.replay
        assert replay.arrives is not None
        minibatch = training.sample()
        # Agent 1 hears agent 0 in slot 0.
        arrives = replay.arrives[0, :, 1, 0].bool()
        lost = arrives if changes == "what arrived" else ~arrives
        if changes != "nothing":
            replay.obs[0, lost, 0] = 3 - replay.obs[0, lost, 0].clamp(max=3)
        uniforms = training.streams.uniforms("dropout", training.learner.update_uniforms)
        training.learner.update(minibatch, uniforms)
        views = training.learner.tensors(0)
        results.append([v[1].clone() for k, v in views.items() if k.startswith("online")])
    same, kept, changed = results
    assert all(torch.equal(a, b) for a, b in zip(same, kept, strict=True))
    assert not all(torch.equal(a, b) for a, b in zip(same, changed, strict=True))


def test_agents_act_by_what_arrives() -> None:
    """Greedy ones as in execution; and it makes a difference."""
    differ = 0
    training = trained(through("loss:0.5", epsilon_start=0.0, epsilon_final=0.0), 30)
    for _ in range(20):
        assert training.lost is not None
        obs, learner = training.games.obs, training.learner
        actions = training.act()
        assert torch.equal(actions, learner.act_greedily(obs, training.replay.received()))
        differ += int((actions != learner.act_greedily(obs)).sum())
        training.play(actions)
    assert differ > 0


def test_the_kernel_learns_what_the_page_learns(monkeypatch: pytest.MonkeyPatch) -> None:
    """With losses now and in the next step that differ, and messages that the mask drops, too."""
    found = []
    for kernel in ("", "torch"):
        use_kernel(kernel, monkeypatch)
        found.append(trained(through("loss:0.4", replay_start_env_steps=80), 30).learner.policy(0))
    for name, tensor in found[0].items():
        torch.testing.assert_close(tensor, found[1][name], rtol=1e-4, atol=2e-5)


def test_losing_nothing_learns_what_no_channel_learns() -> None:
    """The same bits: the memory of arrivals changes no number."""
    whole, none = (
        trained(through(channel, replay_start_env_steps=80), 40).learner.policy(0)
        for channel in ("loss:0", "none")
    )
    assert all(torch.equal(whole[name], none[name]) for name in none)
    lossy = trained(through("loss:0.5", replay_start_env_steps=80), 40).learner.policy(0)
    assert not all(torch.equal(lossy[name], none[name]) for name in none)


def test_all_lost_is_learnt_without_the_others() -> None:
    """The weights of messages never move."""
    training = trained(through("all", rate=0.0, replay_start_env_steps=80), 40)
    begun = trained(through("all", rate=0.0, replay_start_env_steps=80), 0).learner.policy(0)
    moved = training.learner.policy(0)
    assert torch.equal(moved["g1.weight"], begun["g1.weight"])
    assert not torch.equal(moved["f1.weight"], begun["f1.weight"])


@pytest.mark.parametrize("channel", ["bursts:0.3,3", "nearest:2"])
def test_a_run_through_a_channel_goes_on_bit_for_bit(
    channel: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopped in the middle and continued, it is the run that nobody stopped."""
    settings: dict[str, Any] = {
        "epsilon_start": 0.3,
        "replay_start_env_steps": 80,
        "train_env_steps": 800,
    }
    run = through(channel, **settings)
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
    [outcome] = train_cohort([run], tmp_path / "stopped", stop=StopAt(31))
    assert outcome.status == "interrupted"
    paths = [train_cohort([run], tmp_path / root)[0].path for root in ("stopped", "whole")]
    stopped, whole = (read_tensors(path / POLICY) for path in paths)
    assert all(torch.equal(stopped[name], whole[name]) for name in whole)


@pytest.mark.parametrize(
    ("channel", "algorithm", "message"),
    [
        ("noise:1", "dcc", "noise:1 changes the numbers of messages, which is for eval"),
        ("loss:0.2+mean", "dcc", "changes the numbers of messages, which is for eval"),
        ("own", "dcc", "own hands over other messages than the sender's, which is for eval"),
        ("worst:1", "dcc", "worst:1 needs a trained policy, which is for eval"),
        ("half+scale:one", "dcc", "says how trained agents act, which is for eval"),
        ("half+epsilon:0.1", "dcc", "says how trained agents act, which is for eval"),
        ("constant", "dcc", "hands over messages of 255 and more steps ago, which is for eval"),
        ("delay:100+hold:155", "dcc", "hands over messages of 255 and more steps ago"),
        ("silent:7", "dcc", "training.channel: the number of silent agents is at most 6"),
        ("loss:0.2", "maddpg", "these agents hear nobody when they act"),
    ],
)
def test_channels_that_do_more_than_tell_ages_are_refused(
    channel: str, algorithm: str, message: str
) -> None:
    """Before anything is trained."""
    environment = "waterworld-n8" if algorithm == "maddpg" else "pursuit-n6"
    run = planned(algorithm, environment=environment)
    training = replace(run.spec.training, channel=channel)
    with pytest.raises(DefinitionError, match=message):
        Training([replace(run.spec, training=training)])


def test_a_channel_is_part_of_a_run_and_none_is_as_before() -> None:
    """One id for `half` and `links:0.5`; without a channel the id that runs always had."""
    assert through("half").spec.training == through("links:0.5").spec.training
    assert through("none").spec.training == TrainingSpec(**_given(through("none")))
    with pytest.raises(ValueError, match="channel: expected none, half, all"):
        TrainingSpec(channel="2.5")


def _given(run: PlannedRun) -> dict[str, Any]:
    spec = run.spec.training
    names = ("train_env_steps", "games", "log_every_env_steps", "checkpoint_every_env_steps")
    return {name: getattr(spec, name) for name in names}


def test_play_and_restart_are_a_step() -> None:
    """The two halves that training takes apart."""
    training = trained(planned("dcc", time_limit=3), 0)
    env, games = training.env, training.games
    numbers = torch.rand(1, 8, env.step_uniforms), torch.rand(1, 8, env.reset_uniforms)
    for _ in range(5):
        actions = torch.randint(5, (1, 8, 6))
        whole, seen = autoreset.step(env, games, actions, *numbers)
        before, transition = autoreset.play(env, games, actions, numbers[0])
        games = autoreset.restart(env, before, transition, numbers[1])
        assert torch.equal(games.obs, whole.obs)
        assert torch.equal(transition.reward, seen.reward)


def test_the_channel_of_training_is_typed_like_any_setting(tmp_path: Path) -> None:
    """Without quotes, or by its own option: one run, as docs/channels.md says."""
    asked = ("train", "--algorithm", "dcc-md", "--env", "pursuit-n6", "--dry-run", "--json")
    for channel in ("nearest:2", "loss:0.2", "bursts:0.2,4+hold:3", "delay:2"):
        plans = []
        for line in (("--set", f"training.channel={channel}"), ("--channel", channel)):
            said = msgdrop(*asked, "--results", tmp_path, *line)
            assert said.code == 0, said.err
            plans.append(json.loads(said.out)["runs"])
        assert plans[0] == plans[1]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (("noise:1",), "--channel: noise:1 changes the numbers of messages, which is for"),
        (("los:1",), "--channel: no channel is called 'los'; did you mean 'loss'?"),
        (("trace:links.csv",), "--channel: "),
        (("half", "--set", "training.channel=half"), "--set training.channel has an option of its"),
    ],
)
def test_a_channel_that_training_cannot_go_through_is_one_line(
    line: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    """Before anything is trained."""
    said = msgdrop("train", "--results", tmp_path, "--channel", *line)
    assert (said.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert f"msgdrop: error: {message}" in said.err
