"""`msgdrop_cli.load_policy`: a trained policy in a few lines of other people's code."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from msgdrop_cli import Policy, load_policy
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.policy import read_trained
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.errors import RecordError
from msgdrop_cli.messages.received import Received
from msgdrop_envs.parallel import ParallelGame, parallel_env
from tests.runs import planned

PUBLISHED = Path(__file__).resolve().parents[1] / "results" / "published"
RUNS = sorted(file.parent for file in PUBLISHED.glob("*/*/*/policy.safetensors"))
ONE_EACH = {(path.parent.name, path.name.partition("-s")[0]): path for path in RUNS}
Rows = np.ndarray[Any, Any]


def test_every_kind_of_published_policy_is_here() -> None:
    """The tests below would pass without any."""
    assert len(ONE_EACH) >= 9


class FromStreams(ParallelGame):
    """A game with the numbers of a run's first evaluation episode."""

    def use(self, streams: Streams) -> "FromStreams":
        """Take every number from these streams."""
        self._streams = streams
        return self

    def _uniforms(self, count: int) -> torch.Tensor:
        return self._streams.uniforms("evaluate", 1, count)[0, 0]


def played(policy: Policy, game: ParallelGame) -> tuple[int, float]:
    """Steps and return of an episode in a loop that every user of PettingZoo knows."""
    observations, _ = game.reset()
    steps, total = 0, 0.0
    while game.agents:
        observations, rewards, *_ = game.step(policy.act(observations))
        steps, total = steps + 1, total + sum(rewards.values())
    return steps, total


@pytest.mark.parametrize("run", ONE_EACH.values(), ids=["-".join(key) for key in ONE_EACH])
def test_an_episode_in_pettingzoo_is_the_one_of_the_evaluation(run: Path) -> None:
    """Published policies of every learner and game; the same starts give the same end."""
    spec = read_trained(run).spec
    game = parallel_env(spec.environment_config)
    game.__class__ = FromStreams
    assert isinstance(game, FromStreams)
    steps, total = played(load_policy(run), game.use(Streams([spec.seed])))
    [row] = evaluate(run, channel=NONE_BROKEN, episodes=1)
    assert steps == row["steps"]
    assert total == pytest.approx(row["return"], abs=1e-2)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that was trained for a moment."""
    plan = planned("dcc-md", environment="navigation-n8", train_env_steps=160)
    [outcome] = train_cohort([plan], tmp_path_factory.mktemp("results"))
    return outcome.path


@pytest.fixture(scope="module")
def shown(run: Path) -> Rows:
    """What the agents of two games of three each see, [2, 3, N, O]."""
    policy = load_policy(run)
    assert policy.environment == "navigation-n8"
    game = parallel_env("navigation-n8")
    rows = [np.stack(list(game.reset(seed=seed)[0].values())) for seed in range(6)]
    return np.stack(rows).reshape(2, 3, *rows[0].shape)


def test_many_games_are_answered_as_one_by_one(run: Path, shown: Rows) -> None:
    """Leading dimensions stay; numbers are numpy's, and can be written to."""
    policy = load_policy(run)
    actions = policy.act(shown)
    assert (actions.dtype, actions.shape) == (np.int64, shown.shape[:-1])
    for place in np.ndindex(2, 3):
        assert (policy.act(shown[place]) == actions[place]).all()
    actions[0] = 1


def test_double_precision_is_welcome(run: Path, shown: Rows) -> None:
    """It is rounded, as networks see it."""
    policy = load_policy(run)
    assert (policy.act(shown.astype(np.float64) + 1e-12) == policy.act(shown)).all()


def test_messages_that_do_not_arrive_are_not_heard(run: Path, shown: Rows) -> None:
    """As in evaluation: keep [..., N, S] is what `act_greedily` takes."""
    policy, learner = load_policy(run), read_trained(run).learner
    keep = np.random.default_rng(3).random((2, 3, 8, 7)) < 0.5
    flat = torch.from_numpy(shown).flatten(0, 1)[None], torch.from_numpy(keep).flatten(0, 1)[None]
    expected = learner.act_greedily(flat[0], Received(flat[1].float()))[0].view(2, 3, 8)
    assert (policy.act(shown, keep) == expected.numpy()).all()
    assert (policy.act(shown, np.ones_like(keep)) == policy.act(shown)).all()


def test_names_are_answered_whatever_their_order(run: Path, shown: Rows) -> None:
    """A dictionary is no order: who sees what decides."""
    policy = load_policy(run)
    assert policy.agents is not None
    by_name = dict(zip(policy.agents, shown[0, 0], strict=True))
    backwards = dict(reversed(by_name.items()))
    assert policy.act(backwards) == policy.act(by_name)
    assert list(policy.act(by_name).values()) == policy.act(shown[0, 0]).tolist()


def test_what_is_no_observation_is_refused(run: Path, shown: Rows) -> None:
    """With the shape that is expected."""
    policy = load_policy(run)
    size = shown.shape[-1]
    with pytest.raises(ValueError, match=rf"observations must be \[\.\.\., 8, {size}\], not \[8\]"):
        policy.act(shown[0, 0, :, 0])
    with pytest.raises(ValueError, match=r"keep must be \[\.\.\., 8, 7\], not \[8, 8\]"):
        policy.act(shown[0, 0], np.ones((8, 8)))
    with pytest.raises(ValueError, match="keep must have the leading dimensions"):
        policy.act(shown[0], np.ones((8, 7)))
    with pytest.raises(ValueError, match="observations are needed of"):
        policy.act({"somebody": shown[0, 0, 0]})
    for number in (np.nan, np.inf):
        strange = shown[0, 0].astype(np.float32)
        strange[2, 1] = number
        with pytest.raises(ValueError, match="observations must be finite numbers"):
            policy.act(strange)
    with pytest.raises(ValueError, match="observations must be finite numbers"):
        policy.act(shown[0, 0].astype(str))
    with pytest.raises(ValueError, match="keep must be 0 or 1 for each message"):
        policy.act(shown[0, 0], np.full((8, 7), 0.5))


def test_observations_that_this_game_never_shows_are_not_rounded() -> None:
    """Pursuit shows whole numbers; noise on them would be cut off without a word."""
    run = next(path for key, path in ONE_EACH.items() if key[0] == "pursuit-n6")
    policy = load_policy(run)
    game = parallel_env("pursuit-n6")
    seen = np.stack(list(game.reset(seed=1)[0].values()))
    assert (policy.act(seen.astype(np.float64)) == policy.act(seen)).all()
    with pytest.raises(ValueError, match="observations of pursuit-n6 are"):
        policy.act(seen + 0.5)


def test_what_is_no_trained_run_is_named(run: Path, tmp_path: Path) -> None:
    """A folder of runs, a run without a policy, a damaged one, one of another game."""
    with pytest.raises(RecordError, match=r"is no run's folder: there is no run\.json in it"):
        load_policy(run.parent)
    copy = shutil.copytree(run, tmp_path / run.name)
    policy = (copy / "policy.safetensors").read_bytes()
    (copy / "policy.safetensors").unlink()
    with pytest.raises(RecordError, match=r"has no policy\.safetensors: the run is done"):
        load_policy(copy)
    (copy / "policy.safetensors").write_bytes(policy[:100])
    with pytest.raises(RecordError, match=r"policy\.safetensors: is damaged"):
        load_policy(str(copy))
    record = json.loads((copy / "run.json").read_text())
    record["spec"]["environment"]["name"] = "chess"
    (copy / "run.json").write_text(json.dumps(record))
    with pytest.raises(RecordError, match="no environment is called 'chess'"):
        load_policy(copy)


def test_channels_stay_the_evaluations_own(run: Path) -> None:
    """All links broken is keep 0 everywhere."""
    spec = read_trained(run).spec
    game = parallel_env(spec.environment_config)
    game.__class__ = FromStreams
    assert isinstance(game, FromStreams)
    policy, nothing = load_policy(run), np.zeros((8, 7))
    observations, _ = game.use(Streams([spec.seed])).reset()
    total = 0.0
    while game.agents:
        observations, rewards, *_ = game.step(policy.act(observations, nothing))
        total += sum(rewards.values())
    [row] = evaluate(run, channel=Channel.read(1.0), episodes=1)
    assert total == pytest.approx(row["return"], abs=1e-2)


def test_a_policy_that_is_too_large_is_not_read(run: Path, tmp_path: Path) -> None:
    """A hole of two gigabytes takes no room on a disk, but would take them in the memory."""
    shutil.copytree(run, tmp_path / run.name)
    with (tmp_path / run.name / "policy.safetensors").open("r+b") as file:
        file.truncate(2**31 - 1)
    with pytest.raises(RecordError, match=r"policy\.safetensors: .* has more than \d,\d{3},\d{3} "):
        load_policy(tmp_path / run.name)
