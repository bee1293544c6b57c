"""Any PettingZoo `ParallelEnv` is trained, evaluated and resumed like our own games, or refused."""

from collections.abc import Callable

import pytest
import torch

from msgdrop_cli.errors import DefinitionError
from msgdrop_envs import autoreset, registry
from msgdrop_envs.foreign.config import Config, in_its_units
from msgdrop_envs.foreign.live import Live
from msgdrop_envs.foreign.rules import Foreign
from msgdrop_envs.foreign.survey import survey
from tests import somebodys_game
from tests.runs import foreign_run


@pytest.fixture(autouse=True)
def _nothing_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    """What one test asks for is not asked for in the next."""
    monkeypatch.setenv("MSGDROP_FACTORIES", "")


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
        ("Leaves", "makes no game: SystemExit: no display"),
        ("Stumbles", "Stumbles: step() fails: AssertionError: not a second time"),
        ("nobody", "gives a object, expected a PettingZoo ParallelEnv"),
        ("nothing", "has no attribute 'nothing'"),
    ],
)
def test_what_cannot_be_learnt_is_refused_in_a_line(game: str, said: str) -> None:
    """Before anything is written, with what to do where there is something."""
    with pytest.raises(DefinitionError) as caught:
        foreign_run(game)
    assert str(caught.value).isprintable()
    assert said in str(caught.value)


def test_who_has_left_sees_and_gets_nothing() -> None:
    """Whatever the game goes on saying; what comes with the end itself counts."""
    live = Live(survey("tests.somebodys_game:Gossip"))
    live.go_to(1, torch.empty(0, 3))
    told = [(live.step(torch.zeros(3)).reward.tolist(), live.obs.sum(-1).tolist()) for _ in "123"]
    assert told == [([1.0] * 3, [2.0] * 3)] * 2 + [([0.0, 1.0, 1.0], [0.0, 2.0, 2.0])]


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
