"""DDPG, MADDPG and MADDPG-MD: sizes, masks, noise, settings, and whole runs of a short game."""

from pathlib import Path
from typing import Any

import pytest
import torch

from msgdrop_cli.algorithms.maddpg import MADDPG, NAMED, Config
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.replay import Replay
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.training import Training
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.messages.received import Received
from msgdrop_cli.networks.stacked import parameter_count
from msgdrop_cli.ops.exploration import noisy_action, normals, random_action
from msgdrop_cli.ops.minibatch import Batch
from msgdrop_envs import registry
from msgdrop_envs.protocol import Transition
from tests.dcc_samples import rand
from tests.maddpg_samples import (
    ACTION,
    AGENTS,
    OBSERVATION,
    SIZE,
    everything,
    make_batch,
    make_learner,
    mask_uniforms,
    small_config,
)
from tests.minibatches import in_memory
from tests.runs import StopAt, digest, planned


@pytest.mark.parametrize(
    ("name", "environment", "critic"),
    [
        ("maddpg-md", "waterworld-n8", 172_129),  # 154-200, 202-100; 1078-100; 200-64-1
        ("maddpg", "waterworld-n10", 202_929),  # g hears two agents more
        ("ddpg", "waterworld-n8", 57_829),  # 154-200, 202-100; 100-64-1
        ("vanilla-maddpg", "waterworld-n8", 273_229),  # 1232-200-100-64-1
    ],
)
@pytest.mark.parametrize("shared", [True, False], ids=["shared", "independent"])
def test_networks_have_the_papers_parameters(
    name: str, environment: str, critic: int, shared: bool
) -> None:
    """Figure 9's sizes (l. 768-770), once a run or once an agent."""
    env = registry.make(environment)
    learner = MADDPG([Config(**NAMED[name], shares_parameters=shared)], env)
    assert parameter_count(learner.critic.layers) == critic
    assert parameter_count(learner.actor.layers) == 153 * 64 + 65 * 2
    copies = 1 if shared else env.agents
    assert learner.critics.online.networks == learner.actors.online.networks == copies
    assert learner.init_uniforms == copies * (critic + 153 * 64 + 65 * 2)
    assert {len(view) for view in learner.policy(0).values()} == {copies}


def _after(config: Config, batches: int = 3, seed: int = 0) -> torch.Tensor:
    learner = make_learner(config)
    for step in range(batches):
        uniforms = mask_uniforms(learner, seed=seed + step)
        learner.update(in_memory(make_batch(seed=10 * step)), uniforms)
    return everything(learner)


def test_rate_0_is_maddpg_bit_for_bit() -> None:
    """Whatever numbers the mask draws: nothing is dropped, nothing is scaled."""
    assert Config(**NAMED["maddpg"]) == Config(**{**NAMED["maddpg-md"], "rate": 0.0})
    expected = _after(small_config(rate=0.0), seed=1)
    assert torch.equal(_after(small_config(rate=0.0), seed=7), expected)
    assert torch.equal(_after(small_config(rate=0.0, masks_actions=True)), expected)
    assert not torch.equal(_after(small_config(rate=0.5)), expected)


def _changed(batch: Batch, part: str, agent: int) -> Batch:
    """Another one where `agent` saw, or then saw, or did, something else."""
    tensor = getattr(batch, "action" if part == "action" else "obs").clone()
    rows = {"obs": slice(0, SIZE), "next_obs": slice(SIZE, None), "action": slice(None)}[part]
    tensor[:, rows, agent] += 0.3
    return batch._replace(**{"action" if part == "action" else "obs": tensor})


@pytest.mark.parametrize("network", ["fgh", "concat"])
@pytest.mark.parametrize(
    ("part", "masks_actions", "blind"),
    [
        ("obs", False, True),
        ("action", False, False),
        ("action", True, True),
    ],
)
def test_critic_is_blind_to_masked_senders(
    network: str, part: str, masks_actions: bool, blind: bool
) -> None:
    """What a dropped agent saw is nowhere in the others' critics; its action is by default."""
    settings: dict[str, Any] = {"network": network, "masks_actions": masks_actions}
    learner = make_learner(small_config(**settings, rate=1.0, shares_parameters=False))
    other = make_learner(small_config(**settings, rate=1.0, shares_parameters=False))
    batch, uniforms = make_batch(), mask_uniforms(learner)
    learner.update(in_memory(batch), uniforms)
    other.update(in_memory(_changed(batch, part, 2)), uniforms)
    # Adam's first step is the sign of the gradient, so actors may move alike by chance.
    for half in ("critics", "actors") if blind else ("critics",):
        before, after = (
            getattr(made, half).online.of_networks(0, AGENTS) for made in (learner, other)
        )
        same = [
            all(torch.equal(before[key][n], after[key][n]) for key in before) for n in range(AGENTS)
        ]
        assert same[:2] == [blind, blind]
        assert half == "actors" or not same[2]


def test_one_mask_serves_x_and_next_x() -> None:
    """Of what is masked the critic sees nothing, neither now nor then; per sample and sender."""
    config = small_config(rate=0.5, shares_parameters=False)
    learner = make_learner(config)
    uniforms = mask_uniforms(learner)
    keep = uniforms.view(AGENTS, SIZE, AGENTS - 1) >= 0.5
    assert 0 < keep.float().mean() < 1
    calls: list[torch.Tensor] = []
    forward = learner.critic.forward

    def spy(weights: Any, own: Any, action: Any, others: torch.Tensor) -> Any:
        calls.append(others)
        return forward(weights, own, action, others)

    learner.critic.forward = spy  # type: ignore[method-assign]
    learner.update(in_memory(make_batch()), uniforms)
    assert len(calls) == 3  # the target's, the critic's, the policy gradient's
    for others in calls:
        seen, acted = others.split([(AGENTS - 1) * OBSERVATION, (AGENTS - 1) * ACTION], -1)
        blocks = seen.view(AGENTS, SIZE, AGENTS - 1, OBSERVATION)
        assert torch.equal((blocks != 0).all(-1), keep)
        assert torch.equal((blocks != 0).any(-1), keep)
        assert (acted != 0).all()


def test_normals_are_normal() -> None:
    """Mean, variance, tails and independence of the components; the edges stay finite."""
    numbers = normals(rand(200_000, 4, seed=1))
    assert numbers.shape == (200_000, 2)
    assert numbers.mean(0).abs().max() < 0.01
    assert (numbers.var(0) - 1.0).abs().max() < 0.02
    assert abs(float((numbers.abs() > 1.96).float().mean()) - 0.05) < 0.002
    assert abs(float((numbers[:, 0] * numbers[:, 1]).mean())) < 0.01
    edge = torch.tensor([0.0, 1.0 - 2.0**-24])
    assert normals(torch.cartesian_prod(edge, edge)).isfinite().all()


def test_noise_is_added_to_the_action_and_clipped() -> None:
    """Standard deviation 0.15 around the action (l. 772), never outside [-1, 1]."""
    uniforms = rand(100_000, 4, seed=2)
    noisy = noisy_action(torch.tensor([0.2, -0.3]), uniforms, 0.15)
    assert (noisy.mean(0) - torch.tensor([0.2, -0.3])).abs().max() < 0.003
    assert (noisy.std(0) - 0.15).abs().max() < 0.003
    clipped = noisy_action(torch.tensor([0.99, -0.99]), uniforms, 0.15)
    assert (float(clipped.max()), float(clipped.min())) == (1.0, -1.0)
    assert random_action(uniforms).std(0).allclose(torch.tensor(3.0**-0.5), atol=0.01)


def test_acts_at_random_then_with_noise_and_without_it_greedily() -> None:
    """Random until learning begins; greedy is the actor alone, whatever links break."""
    learner = make_learner(small_config(replay_start_env_steps=100))
    obs, uniforms = rand(1, 400, AGENTS, OBSERVATION, seed=1), rand(1, 400, AGENTS, 4, seed=2)
    greedy = learner.act_greedily(obs)
    assert torch.equal(learner.act_greedily(obs, Received(torch.zeros(1, 400, AGENTS, 2))), greedy)
    assert torch.equal(learner.act(obs, uniforms, 99), 2.0 * uniforms[..., :2] - 1.0)
    noise = learner.act(obs, uniforms, 100) - greedy
    assert abs(float(noise.std()) - 0.15) < 0.01
    silent = make_learner(small_config(replay_start_env_steps=100, noise=0.0))
    assert torch.equal(silent.act(obs, uniforms, 100), greedy)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"gamma": 1.1}, "gamma"),
        ({"tau": float("nan")}, "tau"),
        ({"noise": -0.1}, "noise"),
        ({"learning_rate": float("nan")}, "learning_rate"),
        ({"max_gradient_norm": -1.0}, "max_gradient_norm"),
        ({"actor_units": 0}, "actor_units"),
        ({"batch_size": 0}, "batch_size"),
        ({"f_units": (200, 0)}, "f_units"),
        ({"update_every_env_steps": 0}, "update_every_env_steps"),
        ({"actor_update_every_env_steps": 7}, "multiple"),
    ],
)
def test_impossible_settings_are_refused(changes: dict[str, Any], word: str) -> None:
    """Each with the name of the field."""
    with pytest.raises(ValueError, match=word):
        Config(**changes)


def test_refuses_single_actions_and_unlike_runs() -> None:
    """Pursuit has five choices; a cohort shares everything but the rate."""
    with pytest.raises(DefinitionError, match="single actions"):
        MADDPG([Config()], registry.make("pursuit-n6"))
    with pytest.raises(ValueError, match="rate only"):
        make_learner(small_config(), small_config(noise=0.1))


def test_replay_gathers_joint_transitions_of_numbers() -> None:
    """Each run draws its own rows; all agents' parts belong to the same moment."""
    shape: dict[str, Any] = {"runs": 2, "games": 2, "agents": AGENTS, "observation": 1}
    replay = Replay(**shape, time_limit=3, dtype=torch.float32, capacity=12, action_size=2)

    def seen(step: float) -> torch.Tensor:
        """Run, game, agent and step in one number: [2, 2, N, 1]."""
        grid = torch.arange(2 * 2 * AGENTS).view(2, 2, AGENTS, 1)
        return 100.0 * grid + step

    replay.begin(seen(0))
    for t in range(9):
        ended, then = torch.full((2, 2), t % 3 == 2), seen(t + 1)
        last = then + 0.5 * ended[..., None, None]  # what is seen before the restart
        transition = Transition(last, then[..., 0], torch.ones(2, 2), ended, {})
        replay.add(seen(t).expand(-1, -1, -1, 2) / 10, transition, then)
    drawn = torch.tensor([[0, 5, 11, 7], [3, 3, 10, 4]])
    batch = replay.minibatch(replay.rows(drawn), torch.arange(AGENTS)[:, None]).copied()
    assert batch.obs.shape == (2, 8, AGENTS, 1)
    step, game = 3 + drawn // 2, drawn % 2  # the oldest of six steps is the fourth
    run = torch.arange(2)[:, None]
    now = seen(0)[run, game] + step[..., None, None]  # [2, 4, N, 1]
    cut = (step % 3 == 2)[..., None, None]
    assert torch.equal(batch.obs[:, :4], now)
    assert torch.equal(batch.obs[:, 4:], now + 1 + 0.5 * cut)
    assert torch.equal(batch.action, now.expand(-1, -1, -1, 2) / 10)
    assert torch.equal(batch.reward, now[..., 0] + 1)
    assert torch.equal(batch.discount, torch.ones(2, 4))


def _planned(algorithm: str, **changes: Any) -> PlannedRun:
    settings = {"time_limit": 30, "environment": "waterworld-n8", "train_env_steps": 320}
    return planned(algorithm, **{**settings, **changes})


def _train(runs: list[PlannedRun], root: Path) -> list[str]:
    outcomes = train_cohort(runs, root)
    assert [outcome.status for outcome in outcomes] == ["done"] * len(runs), outcomes
    return [digest(outcome.path) for outcome in outcomes]


@pytest.mark.parametrize("shared", [True, False], ids=["shared", "independent"])
@pytest.mark.parametrize("algorithm", NAMED)
def test_alone_and_in_a_cohort(algorithm: str, shared: bool, tmp_path: Path) -> None:
    """Stacked with other seeds (and rates), a run gives the bits that it gives alone."""
    settings: dict[str, Any] = {"shares_parameters": shared, "train_env_steps": 200}
    runs = [_planned(algorithm, seed=seed, **settings) for seed in (1, 2)]
    if algorithm == "maddpg-md":
        runs.append(_planned(algorithm, seed=3, rate=0.5, **settings))
    together = _train(runs, tmp_path / "together")
    alone = [_train([run], tmp_path / "alone")[0] for run in runs]
    assert together == alone
    assert len(set(alone)) == len(runs)


@pytest.mark.parametrize("steps", [5, 14, 20, 27])
@pytest.mark.parametrize("shared", [True, False], ids=["shared", "independent"])
def test_stopped_and_resumed_is_undisturbed(
    steps: int, shared: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before learning, between the actor's updates, at and after checkpoints: the same bits."""
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
    run = _planned("maddpg-md", shares_parameters=shared)
    expected = _train([run], tmp_path / "undisturbed")[0]
    [outcome] = train_cohort([run], tmp_path / "stopped", stop=StopAt(steps))
    assert (outcome.status, outcome.env_steps) == ("interrupted", 8 * steps)
    assert _train([run], tmp_path / "stopped")[0] == expected


def test_critic_and_actor_are_updated_at_the_papers_pace() -> None:
    """Once in 5 env steps (l. 772) from the step on that passes the start."""
    training = Training([_planned("maddpg").spec])
    training.begin()
    while training.env_steps < 320:
        training.advance()
    assert (
        training.learner.progress[0] == 320 // 5 - 96 // 5
    )  # 104 env steps are the first beyond 100


def test_evaluation_does_not_notice_broken_links(tmp_path: Path) -> None:
    """The same episodes, number by number: actors hear nobody."""
    [outcome] = train_cohort([_planned("maddpg-md", train_env_steps=120)], tmp_path)
    whole, broken = (
        evaluate(outcome.path, channel=Channel.read(f), episodes=3) for f in (0.0, 1.0)
    )
    assert [{**row, "broken_links": 0.0} for row in broken] == whole
    assert len(whole) == 3
