"""Runs in games of other people: resumed, refused, evaluated and acted in; the page of the docs."""

import json
import re
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from msgdrop_cli import load_policy
from msgdrop_cli.definition.channel import NONE_BROKEN
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.registration import registered_as
from msgdrop_cli.definition.spec import Registration
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.play_references import play_references
from msgdrop_cli.engine.policy import read_trained
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.store import list_runs
from msgdrop_envs import registry
from msgdrop_envs.foreign import factory
from tests import somebodys_game
from tests.cli_runs import msgdrop
from tests.runs import StopAt, digest, foreign_run

EXTRA = '[profiles.ours]\nseeds = 2\nenvironments = ["pursuit-n6"]\n'
DOCS = Path(__file__).resolve().parents[1] / "docs" / "pettingzoo.md"


@pytest.fixture(autouse=True)
def _nothing_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    """What one test asks for is not asked for in the next."""
    monkeypatch.setenv("MSGDROP_FACTORIES", "")


@pytest.fixture
def _asked_at_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes `stop` precise: it is asked after every step instead of twice a second."""
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)


@pytest.mark.usefixtures("_asked_at_every_step")
@pytest.mark.parametrize(("game", "algorithm"), [("Leaving", "dcc-md"), ("Push", "maddpg-md")])
def test_a_resumed_run_is_the_same_run(tmp_path: Path, game: str, algorithm: str) -> None:
    """A game that repeats itself from its seed goes on bit for bit, in the middle of episodes."""
    run = foreign_run(game, algorithm)
    [whole] = train_cohort([run], tmp_path / "whole")
    [stopped] = train_cohort([run], tmp_path / "stopped", stop=StopAt(23))
    assert (stopped.status, stopped.env_steps) == ("interrupted", 23 * 8)
    [resumed] = train_cohort([run], tmp_path / "stopped")
    assert (resumed.status, resumed.reason) == ("done", None)
    assert digest(resumed.path) == digest(whole.path)


@pytest.mark.usefixtures("_asked_at_every_step")
def test_a_record_says_that_its_game_did_not_repeat_itself(tmp_path: Path) -> None:
    """It is resumed all the same, with the same episodes played differently."""
    run = foreign_run("Restless")
    train_cohort([run], tmp_path, stop=StopAt(23))
    [resumed] = train_cohort([run], tmp_path)
    assert resumed.status == "done"
    [record] = list_runs(resumed.path)
    assert record.reason is not None
    assert record.reason.startswith("not bit-exact")


def test_an_earlier_time_limit_is_no_silent_fault(tmp_path: Path) -> None:
    """Memories are laid out for one truncation in so many steps; the line says which."""
    [outcome] = train_cohort([foreign_run("Shorter")], tmp_path)
    assert outcome.status == "failed"
    assert "ends after 3 steps; say --set environment.time_limit=3" in str(outcome.reason)
    [outcome] = train_cohort([foreign_run("Shorter", "dcc", "environment.time_limit=3")], tmp_path)
    assert outcome.status == "done", outcome.reason


def test_another_version_of_a_game_is_noticed(tmp_path: Path) -> None:
    """What agents see has the size that the record says, or nothing is played."""
    [outcome] = train_cohort(
        [foreign_run("Echo", "dcc", "environment.observation_size=3")], tmp_path
    )
    assert "red sees 2 numbers, expected 3; is it another version?" in str(outcome.reason)


@pytest.fixture
def trained(tmp_path: Path) -> Path:
    """The folder of a run; from here on its factory is not asked for any more."""
    [outcome] = train_cohort([foreign_run("Push", "maddpg-md")], tmp_path / "results")
    assert factory.is_allowed("tests.somebodys_game:Push")
    return outcome.path


def test_a_record_makes_nobody_run_what_it_names(
    trained: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither `eval` of a folder nor reference policies call a factory that nobody asked for."""
    monkeypatch.setenv("MSGDROP_FACTORIES", "")
    monkeypatch.setattr(somebodys_game, "Push", lambda: pytest.fail("was called"))
    with pytest.raises(registry.GameError, match="is other people's code, and not played unasked"):
        evaluate(trained, channel=NONE_BROKEN, episodes=1)
    with pytest.raises(DefinitionError, match="not played unasked"):
        play_references(list_runs(trained)[0].spec, "run.json")
    said = msgdrop("eval", trained.parent.parent, "--episodes", "10")
    assert said.code == 2
    assert "1 finished run left out: they play other people's code" in said.err
    assert "all of your own policies play other people's code: name a run's own folder" in said.err
    assert "MSGDROP_FACTORIES=module:factory" in said.err
    assert load_policy(trained).agents == ("red", "green", "blue")


def test_the_folder_of_a_run_is_a_wish(trained: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`eval RUN` finds the factory in the record, and plays."""
    monkeypatch.setenv("MSGDROP_FACTORIES", "")
    said = msgdrop("eval", trained, "--episodes", "10", "--workers", "1")
    assert said.code == 0, said.err
    assert "tests.somebodys_game.Push after 480 env steps" in said.out
    assert "(random)" in said.out


def test_its_policy_acts_in_the_games_own_units(trained: Path) -> None:
    """In the loop of PettingZoo it gets what evaluation counts, from the same seed."""
    [row] = evaluate(trained, channel=NONE_BROKEN, episodes=1)
    spec = list_runs(trained)[0].spec
    policy, game, total = load_policy(trained), somebodys_game.Push(), 0.0
    seed = Streams([spec["seed"]]).uniforms("evaluate", 1, 1)[0, 0, 0] * 2**24
    observations, _ = game.reset(seed=int(seed))
    while game.agents:
        observations, rewards, *_ = game.step(policy.act(observations))
        total += sum(rewards.values())
    assert total == pytest.approx(row["return"], abs=1e-3)


def test_agents_may_leave_before_a_policy_does(tmp_path: Path) -> None:
    """Who has left is not answered, and is for the others what it was in training: zeros."""
    [outcome] = train_cohort([foreign_run("Leaving")], tmp_path)
    policy, learner = load_policy(outcome.path), read_trained(outcome.path).learner
    seen = {"green": np.array([[1.0], [0.5]]), "blue": np.array([[0.0], [0.5]])}
    rows = torch.tensor([[[[0.0, 0.0], [1.0, 0.5], [0.0, 0.5]]]])
    expected = learner.act_greedily(rows)[0, 0].tolist()
    assert policy.act(seen) == {"green": expected[1], "blue": expected[2]}
    with pytest.raises(ValueError, match="observations are needed of"):
        policy.act({**seen, "white": seen["blue"]})


def test_a_graphics_card_is_refused(question: Path) -> None:
    """Before anything is made."""
    for asked in (("train", "--env", "tests.somebodys_game:Echo"), ("ablate", question)):
        said = msgdrop(*asked, "--device", "cuda")
        assert said.code == 2
        assert "games of other people are played with --device cpu" in said.err


@pytest.fixture
def question(tmp_path: Path) -> Path:
    """The one of the page about Echo, of two seeds and some steps."""
    [text] = re.findall(r"```toml\n(.*?)```", DOCS.read_text(), re.DOTALL)
    for long, short in (
        ("lamps:make", "tests.somebodys_game:Echo"),
        ("100_000 }", "400 }\nalgorithm = { replay_start_env_steps = 100 }"),
        ("seeds = 6", "seeds = 2"),
        ("episodes = 200", "episodes = 4"),
        ("[[claims]]", 'seen_in = { "tests.somebodys_game:Echo" = 6 }\n[[claims]]'),
    ):
        text = text.replace(long, short)
    (tmp_path / "mine.toml").write_text(text)
    return tmp_path / "mine.toml"


def test_a_question_names_a_factory(question: Path) -> None:
    """Its runs are trained, its claim is compared, and what was seen counts in the game's name."""
    said = msgdrop("ablate", question, "--results", question.parent, "--workers", "1")
    assert said.code == 0, said.err
    assert "md-0.2 against dcc: return per episode after training, half" in said.out
    assert "look that can decide is at 10" in said.err
    runs, asked = list_runs(question.parent), load_definition(str(question))
    assert {run.environment for run in runs} == {"tests.somebodys_game.Echo"}
    assert {run.registration for run in runs} == {registered_as(asked, runs[0].environment)}
    unseen = replace(asked, registration=Registration(looks=(6, 10), alpha_spent=(0.04, 0.05)))
    assert runs[0].registration != registered_as(unseen, runs[0].environment)
    assert len(runs) == 6


def test_every_setting_of_such_a_game_is_shown(question: Path) -> None:
    """Its time limit among them, which can be set."""
    said = msgdrop("config", "show", question)
    assert (said.code, "environment.time_limit=5" in said.out) == (0, True)
    assert "environment.factory=tests.somebodys_game:Echo" in said.out


def test_a_reading_is_of_the_games_that_a_profile_has(question: Path) -> None:
    """A factory that the profile leaves out has no readings, and stands in no one's way."""
    text = question.read_text().replace("[registration]\n", EXTRA + "[registration]\n")
    question.write_text(text.replace("ents = [", 'ents = ["pursuit-n6", ', 1))
    said = msgdrop("config", "show", question, "--profile", "ours", "--reading", "huber")
    assert (said.code, "algorithm.loss=huber" in said.out) == (0, True), said.err


def test_a_name_that_is_no_factory_is_refused(question: Path) -> None:
    """Neither in a question nor elsewhere."""
    question.write_text(question.read_text().replace("somebodys_game:Echo", "somebodys_game:Ec:ho"))
    said = msgdrop("ablate", question, "--results", question.parent)
    assert said.code == 2
    assert "'tests.somebodys_game:Ec:ho': expected package.module:factory" in said.err


@pytest.mark.slow
def test_workers_find_the_factory(tmp_path: Path) -> None:
    """It stands in the record, and what was asked for here is asked for there."""
    where = ("--results", tmp_path, "--workers", "2", "--seeds", "2", "--steps", "400")
    small = ("--set", "algorithm.replay_start_env_steps=100")
    said = msgdrop("train", "--env", "tests.somebodys_game:Echo", *where, *small)
    assert said.code == 0, said.err
    assert [run.status for run in list_runs(tmp_path)] == ["done", "done"]


def test_the_page_says_what_happens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its game is saved as it stands there, its commands are typed, its loop is run."""
    text = DOCS.read_text()
    game, loop = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "lamps.py").write_text(game)
    [lines] = re.findall(r"```console\n(.*?)```", text, re.DOTALL)
    for line in lines.splitlines():
        words = shlex.split(line.removeprefix("$ msgdrop "), comments=True)
        short = ["--episodes", "20"] if words[0] == "eval" else ["--steps", "800"]
        for each in sorted(tmp_path.glob("results/runs/*/*")):
            words = [str(each) if word == "RUN" else word for word in words]
        said = msgdrop(*words, *short, "--workers", "1")
        assert said.code == 0, said.err
        assert "lamps.make after 800 env steps" in said.out
    [run] = tmp_path.glob("results/runs/*/*")
    exec(loop.replace("RUN", str(run)), {})


def test_what_a_game_says_spoils_no_result(tmp_path: Path) -> None:
    """It goes to stderr, so that `--json` is JSON; a step that fails is one line about the game."""
    line = ("train", "--algorithm", "dcc", "--steps", "40", "--results", tmp_path, "--workers", "1")
    said = msgdrop(*line, "--env", "tests.somebodys_game:Talks", "--json")
    assert said.code == 0, said.err
    assert json.loads(said.out)["results"]
    assert "a step" in said.err
    said = msgdrop(*line, "--env", "tests.somebodys_game:Stumbles")
    assert (said.code, said.out) == (2, "")
    assert "tests.somebodys_game:Stumbles: step() fails: AssertionError" in said.err
    assert "bug in msgdrop" not in said.err
