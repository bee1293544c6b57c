"""Any PettingZoo `ParallelEnv` is trained, evaluated and resumed like our own games, or refused."""

import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from msgdrop_cli import load_policy
from msgdrop_cli.definition.channel import NONE_BROKEN
from msgdrop_cli.definition.plan import ad_hoc_definition, plan
from msgdrop_cli.definition.spec import PlannedRun, Profile
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.engine.play_references import play_references
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.store import list_runs
from msgdrop_envs import autoreset, registry
from msgdrop_envs.foreign import factory
from msgdrop_envs.foreign.config import Config, in_its_units
from msgdrop_envs.foreign.live import Live
from msgdrop_envs.foreign.rules import Foreign
from msgdrop_envs.foreign.survey import survey
from tests import somebodys_game
from tests.cli_runs import msgdrop
from tests.runs import StopAt, digest

DOCS = Path(__file__).resolve().parents[1] / "docs" / "pettingzoo.md"


@pytest.fixture(autouse=True)
def _nothing_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    """What one test asks for is not asked for in the next."""
    monkeypatch.setenv("MSGDROP_FACTORIES", "")


def run_of(game: str, algorithm: str = "dcc-md", *overrides: str, steps: int = 480) -> PlannedRun:
    """A run of a few hundred env steps, as `train --env` plans it."""
    training = {"train_env_steps": steps, "log_every_env_steps": 80}
    training["checkpoint_every_env_steps"] = 160
    name = f"tests.somebodys_game:{game}"
    question = ad_hoc_definition(name, [algorithm], "tiny", Profile(seeds=1, training=training))
    small = ("algorithm.replay_start_env_steps=100", "algorithm.replay_capacity=200")
    [run] = plan(question, "tiny", catalogue(), overrides=[*small, *overrides]).runs
    return run


def test_a_survey_finds_out_what_learners_need() -> None:
    """Pictures are flat, the time limit is where random play is truncated."""
    assert survey("tests.somebodys_game:Echo") == Config(
        factory="tests.somebodys_game:Echo",
        agent_names=("red", "green", "blue"),
        observation_size=2,
        actions=2,
        time_limit=5,
    )
    push = survey("tests.somebodys_game:Push")
    assert (push.actions, push.action_low, push.action_high) == (0, (-1.0, -1.0), (3.0, 3.0))


@pytest.mark.parametrize(
    ("game", "said"),
    [
        ("Tables", "red sees a Dict, expected a Box; flatten it"),
        ("Unlike", "blue does {'actions': 3}, red {'actions': 2}; make them alike"),
        ("Unbounded", "red does numbers without bounds"),
        ("Joining", "'white' is none of its possible_agents"),
        ("Broken", "makes no game: SystemError: two lines"),
        ("nobody", "gives a object, expected a PettingZoo ParallelEnv"),
        ("nothing", "has no attribute 'nothing'"),
    ],
)
def test_what_cannot_be_learnt_is_refused_in_a_line(game: str, said: str) -> None:
    """Before anything is written, with what to do where there is something."""
    with pytest.raises(DefinitionError) as caught:
        run_of(game)
    assert str(caught.value).isprintable()
    assert said in str(caught.value)


def test_a_step_is_the_games_own() -> None:
    """Observations, rewards and ends of every game in the batch; agents who left see zeros."""
    config = survey("tests.somebodys_game:Leaving")
    env = registry.make(config)
    assert isinstance(env, Foreign)
    games = autoreset.start(env, torch.tensor([[[0.25], [0.5]]]), torch.zeros(1, 2).long())
    others = [somebodys_game.Leaving() for _ in range(2)]
    for other, seed in zip(others, (2**22, 2**23), strict=True):
        other.reset(seed=seed)
    for step in range(1, 5):
        actions = torch.tensor([[[1, 0, 1], [0, 0, 0]]])
        games, transition = autoreset.play(env, games, actions, torch.empty(1, 2, 0))
        for number, other in enumerate(others):
            said = dict(zip(other.possible_agents, actions[0, number].tolist(), strict=True))
            said = {agent: said[agent] for agent in other.agents}
            seen, rewards, *_ = other.step(said)
            for row, agent in enumerate(other.possible_agents):
                expected = torch.zeros(2)
                if agent in seen:
                    expected = torch.from_numpy(seen[agent]).flatten()
                assert torch.equal(games.obs[0, number, row], expected), (step, agent)
                assert transition.reward[0, number, row] == rewards.get(agent, 0.0)
        assert transition.ended.tolist() == [[step == 4] * 2]
        assert transition.discount.tolist() == [[float(step < 4)] * 2]


def test_a_time_limit_keeps_the_discount() -> None:
    """Truncated is not ended; what ended begins anew, the others go on."""
    env = registry.make(survey("tests.somebodys_game:Echo"))
    uniforms = torch.full((1, 2, 1), 0.5)
    games = autoreset.start(env, uniforms, torch.tensor([[0, 2]]))
    for step in range(1, 6):
        nothing = torch.zeros(1, 2, 3).long()
        fresh = torch.full((1, 2, 1), 0.1 * step)
        games, transition = autoreset.step(env, games, nothing, torch.empty(1, 2, 0), fresh)
        assert transition.ended.tolist() == [[step == 5, step == 3]]
        assert transition.discount.tolist() == [[1.0, 1.0]]
        assert games.state.steps.tolist() == [[step % 5, step if step < 3 else step - 3]]
    assert games.state.seed.tolist() == [[int(0.5 * 2**24), int(torch.tensor(0.3) * 2**24)]]


def test_only_the_games_that_end_begin_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beginning an episode may take long; the others are left where they are."""
    begun: list[int] = []
    monkeypatch.setattr(Live, "_begin", spied(Live._begin, begun))
    env = registry.make(survey("tests.somebodys_game:Echo"))
    begun.clear()
    rows = torch.tensor([[[0.1], [0.2], [0.3], [0.4]]])
    games = autoreset.start(env, rows.clone(), torch.tensor([[0, 1, 2, 3]]))
    for number in range(10):
        nothing = torch.zeros(1, 4, 3).long()
        fresh = rows + 0.05 * number
        games, _ = autoreset.step(env, games, nothing, torch.empty(1, 4, 0), fresh)
    assert len(begun) == 4 + 4 * 2


def spied(function: Callable[[Live, int], None], seeds: list[int]) -> Callable[[Live, int], None]:
    """The same function, which writes down what it is called with."""

    def called(live: Live, seed: int) -> None:
        seeds.append(seed)
        function(live, seed)

    return called


def test_learners_numbers_become_the_games() -> None:
    """From -1 to 1 is from the game's low to its high, number by number; choices stay."""
    config = Config(
        factory="a:b",
        agent_names=("one",),
        observation_size=1,
        action_low=(-1.0, 0.0),
        action_high=(3.0, 10.0),
    )
    pushed = in_its_units(config, torch.tensor([[-1.0, -1.0], [0.0, 0.5], [1.0, 1.0]]))
    assert pushed.tolist() == [[-1.0, 0.0], [1.0, 7.5], [3.0, 10.0]]
    config = Config(factory="a:b", agent_names=("one",), observation_size=1, actions=3)
    assert in_its_units(config, torch.tensor([2])).tolist() == [2]


@pytest.fixture
def _asked_at_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes `stop` precise: it is asked after every step instead of twice a second."""
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)


@pytest.mark.usefixtures("_asked_at_every_step")
@pytest.mark.parametrize(("game", "algorithm"), [("Leaving", "dcc-md"), ("Push", "maddpg-md")])
def test_a_resumed_run_is_the_same_run(tmp_path: Path, game: str, algorithm: str) -> None:
    """A game that repeats itself from its seed goes on bit for bit, in the middle of episodes."""
    run = run_of(game, algorithm)
    [whole] = train_cohort([run], tmp_path / "whole")
    [stopped] = train_cohort([run], tmp_path / "stopped", stop=StopAt(23))
    assert (stopped.status, stopped.env_steps) == ("interrupted", 23 * 8)
    [resumed] = train_cohort([run], tmp_path / "stopped")
    assert (resumed.status, resumed.reason) == ("done", None)
    assert digest(resumed.path) == digest(whole.path)


@pytest.mark.usefixtures("_asked_at_every_step")
def test_a_record_says_that_its_game_did_not_repeat_itself(tmp_path: Path) -> None:
    """It is resumed all the same, with the same episodes played differently."""
    run = run_of("Restless")
    train_cohort([run], tmp_path, stop=StopAt(23))
    [resumed] = train_cohort([run], tmp_path)
    assert resumed.status == "done"
    [record] = list_runs(resumed.path)
    assert record.reason is not None
    assert record.reason.startswith("not bit-exact")


def test_an_earlier_time_limit_is_no_silent_fault(tmp_path: Path) -> None:
    """Memories are laid out for one truncation in so many steps; the line says which."""
    [outcome] = train_cohort([run_of("Shorter")], tmp_path)
    assert outcome.status == "failed"
    assert "ends after 3 steps; say --set environment.time_limit=3" in str(outcome.reason)
    [outcome] = train_cohort([run_of("Shorter", "dcc", "environment.time_limit=3")], tmp_path)
    assert outcome.status == "done", outcome.reason


def test_another_version_of_a_game_is_noticed(tmp_path: Path) -> None:
    """What agents see has the size that the record says, or nothing is played."""
    [outcome] = train_cohort([run_of("Echo", "dcc", "environment.observation_size=3")], tmp_path)
    assert "red sees 2 numbers, expected 3; is it another version?" in str(outcome.reason)


@pytest.fixture
def trained(tmp_path: Path) -> Path:
    """The folder of a run; from here on its factory is not asked for any more."""
    [outcome] = train_cohort([run_of("Push", "maddpg-md")], tmp_path / "results")
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
        flat = {agent: seen.flatten() for agent, seen in observations.items()}
        observations, rewards, *_ = game.step(policy.act(flat))
        total += sum(rewards.values())
    assert total == pytest.approx(row["return"], abs=1e-3)


def test_a_graphics_card_is_refused() -> None:
    """Before anything is made."""
    said = msgdrop("train", "--env", "tests.somebodys_game:Echo", "--device", "cuda")
    assert said.code == 2
    assert "games of other people are played with --device cpu" in said.err


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
