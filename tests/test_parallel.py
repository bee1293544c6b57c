"""The PettingZoo side: one game of every environment passes its tests and can be set and read."""

import importlib
import json
import sys
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from pettingzoo.test import parallel_api_test, parallel_seed_test, render_test
from pettingzoo.utils import parallel_to_aec

from msgdrop_cli.errors import to_install
from msgdrop_envs import parallel, registry
from msgdrop_envs.parallel import ParallelGame, parallel_env
from msgdrop_envs.pursuit.rules import Config
from msgdrop_envs.waterworld.config import Config as Waterworld

SETTINGS = sorted(name for name, config in registry.settings().items() if registry.view(config))
"""Of the games that can be shown."""
STAY = 4
RING = [[4, 5], [5, 6], [5, 4], [6, 5], [0, 0], [14, 14]]
"""Six pursuers: four of them around (5, 5)."""


def some(space: Box | Discrete, rng: np.random.Generator) -> Any:
    """An action drawn from the space."""
    if isinstance(space, Box):
        return rng.uniform(space.low, space.high).astype(np.float32)
    return int(rng.integers(space.n))


def nothing(game: ParallelGame) -> dict[str, Any]:
    """The action 0 of everybody."""
    spaces = {agent: game.action_space(agent) for agent in game.agents}
    return {
        a: np.zeros(s.shape, np.float32) if isinstance(s, Box) else 0 for a, s in spaces.items()
    }


def play(game: ParallelGame, steps: int, seed: int) -> list[Any]:
    """Rewards and positions of a game with random actions; begins anew when it ends."""
    rng = np.random.default_rng(seed)
    seen: list[Any] = []
    for _ in range(steps):
        if not game.agents:
            game.reset()
        actions = {agent: some(game.action_space(agent), rng) for agent in game.agents}
        _, rewards, *_ = game.step(actions)
        seen.append((rewards, game.state_dict()))
    return seen


def stay(game: ParallelGame) -> tuple[Any, ...]:
    """One step of pursuit in which no pursuer moves."""
    return game.step(dict.fromkeys(game.agents, STAY))


@pytest.mark.parametrize("name", SETTINGS)
def test_passes_the_api_test_of_pettingzoo(name: str) -> None:
    """PettingZoo's own test finds nothing to complain or warn about."""
    parallel_api_test(parallel_env(name), num_cycles=600)


@pytest.mark.parametrize("name", SETTINGS)
def test_passes_the_seed_test_of_pettingzoo(name: str) -> None:
    """Two games with one seed are equal, by PettingZoo's own test."""
    parallel_seed_test(lambda: parallel_env(name), num_cycles=100)


@pytest.mark.parametrize("name", SETTINGS)
def test_passes_the_render_test_of_pettingzoo(name: str) -> None:
    """PettingZoo's own test takes every mode that is promised, and `human` in any case."""
    render_test(lambda render_mode: parallel_to_aec(parallel_env(name, render_mode)))


@pytest.mark.parametrize("name", SETTINGS)
def test_the_state_lies_in_its_space(name: str) -> None:
    """As PettingZoo's `state_test` asks: one space, which holds the state of every position."""
    game = parallel_env(name)
    game.reset(seed=1)
    rng = np.random.default_rng(1)
    for _ in range(200):
        assert game.state_space.contains(game.state())
        if not game.agents:
            game.reset()
        game.step({agent: some(game.action_space(agent), rng) for agent in game.agents})


def test_a_state_space_is_no_wider_than_the_game() -> None:
    """Cells of the map; faster food widens waterworld's; navigation's world has no end."""
    spaces = [parallel_env(name).state_space for name in ("pursuit-n6", "waterworld-n8")]
    assert [(space.low.min(), space.high.max()) for space in spaces] == [(0, 14), (-1, 1)]
    quick = parallel_env(Waterworld(food_speed=8.0))
    quick.reset(seed=1)
    assert quick.state_space.contains(quick.state())
    assert parallel_env("navigation-n8").state_space.high.max() == np.inf


@pytest.mark.parametrize("name", SETTINGS)
def test_seed_decides_the_whole_game(name: str) -> None:
    """One seed gives one game, another seed another; a reset without a seed goes on."""
    first, second = parallel_env(name), parallel_env(name)
    first.reset(seed=5)
    second.reset(seed=5)
    assert play(first, 50, 1) == play(second, 50, 1)
    start, twin = parallel_env(name), parallel_env(name)
    start.reset(seed=6)
    twin.reset(seed=6)
    position = start.state_dict()
    start.reset()
    twin.reset()
    assert start.state_dict() == twin.state_dict() != position
    start.reset(seed=7)
    assert start.state_dict() != position
    start.reset(seed=6)
    assert start.state_dict() == position


@pytest.mark.parametrize("name", SETTINGS)
def test_state_comes_back_as_it_was_given(name: str) -> None:
    """A position goes through JSON and `reset` unchanged, with what all agents see of it."""
    game, other = parallel_env(name), parallel_env(name)
    game.reset(seed=1)
    play(game, 30, 2)
    position = json.loads(json.dumps(game.state_dict()))
    seen, _ = other.reset(seed=9, options={"state": position})
    again, _ = game.reset(seed=3, options={"state": position})
    assert other.state_dict() == position
    for agent in other.possible_agents:
        np.testing.assert_array_equal(seen[agent], again[agent])


@pytest.mark.parametrize("name", SETTINGS)
def test_observations_and_actions_fit_their_spaces(name: str) -> None:
    """Spaces contain what the game gives; each agent's space is one object."""
    game = parallel_env(name)
    obs, infos = game.reset(seed=1)
    assert list(obs) == list(infos) == game.possible_agents == game.agents
    for agent in game.agents:
        assert game.observation_space(agent).contains(obs[agent])
        assert game.observation_space(agent) is game.observation_space(agent)
        assert game.action_space(agent) is game.action_space(agent)


@pytest.mark.parametrize("name", SETTINGS)
def test_pictures_and_text(name: str) -> None:
    """Every render mode shows every position, as PettingZoo types them; no mode shows nothing."""
    picture, text = parallel_env(name, "rgb_array"), parallel_env(name, "ansi")
    for game in (picture, text):
        game.reset(seed=1)
    first = picture.render()
    assert isinstance(first, np.ndarray)
    assert (first.dtype, first.ndim, first.shape[-1]) == (np.uint8, 3, 3)
    play(picture, 3, 1)
    later = picture.render()
    assert isinstance(later, np.ndarray)
    assert not np.array_equal(first, later)
    assert isinstance(text.render(), str)
    silent = parallel_env(name)
    silent.reset(seed=1)
    assert silent.render() is None


@pytest.mark.parametrize("name", SETTINGS)
def test_human_sees_every_position_once(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """It is printed at reset and at each step, and not again by `render()`."""
    game, text = parallel_env(name, "human"), parallel_env(name, "ansi")
    texts = []
    for each in (game, text):
        each.reset(seed=1)
        texts.append(each.render())
        play(each, 1, 1)
        texts.append(each.render())
    assert texts[:2] == [None, None]
    assert capsys.readouterr().out == "".join(f"{each}\n" for each in texts[2:])


@pytest.mark.parametrize("name", SETTINGS)
def test_time_limit_truncates(name: str) -> None:
    """At the time limit no one is terminated and all are truncated, one step earlier no one."""
    game = parallel_env(name)
    limit = registry.settings()[name].time_limit
    for seed in range(20):
        game.reset(seed=seed)
        for step in range(1, limit + 1):
            _, _, terminations, truncations, _ = game.step(nothing(game))
            if any(terminations.values()):
                break  # this game ended by itself: the next seed
            assert list(truncations.values()) == [step == limit] * len(truncations)
        else:
            assert game.agents == []
            game.reset()
            *_, truncations, _ = game.step(nothing(game))
            assert not any(truncations.values()), "the next game counts its own steps"
            return
    pytest.fail("no game lasted until its time limit")


def test_true_end_terminates() -> None:
    """Capturing the last evader terminates all pursuers, pays them, and empties `agents`."""
    game = parallel_env("pursuit-n6")
    around = {"pursuers": RING, "evaders": [[5, 5], None]}
    game.reset(seed=1, options={"state": around})
    obs, rewards, terminations, truncations, infos = stay(game)
    assert list(rewards.values()) == pytest.approx([4.95] * 4 + [-0.05] * 2)
    assert set(terminations.values()) == {True}
    assert set(truncations.values()) == {False}
    assert infos["pursuer_0"] == {"catches": 1.0, "edge_hits": 0.0}
    assert game.state_dict() == {"pursuers": RING, "evaders": [None, None]}
    assert list(obs) == game.possible_agents
    assert game.agents == []
    assert game.step({}) == ({}, {}, {}, {}, {})


def test_given_state_keeps_the_random_numbers_of_the_seed() -> None:
    """Evaders draw the same moves after a reset with and without a position."""
    games = [parallel_env("pursuit-n6") for _ in range(2)]
    games[0].reset(seed=3)
    far = {"pursuers": [[0, 0]] * 6, "evaders": [[7, 7], [7, 7]]}
    games[1].reset(seed=3, options={"state": far})
    games[0].reset(seed=3)
    for game in games:
        stay(game)
    assert games[0].state_dict()["evaders"] == games[1].state_dict()["evaders"]


def test_names_are_pettingzoos() -> None:
    """The metadata carries name and version, the agents are numbered pursuers."""
    game = parallel_env("pursuit-n6")
    assert game.metadata["name"] == "pursuit_n6_v0"
    assert game.metadata["render_modes"] == ["human", "rgb_array", "ansi"]
    assert game.possible_agents == [f"pursuer_{number}" for number in range(6)]
    assert str(parallel_env(Config(pursuers=2))) == "pursuit_v0"
    assert len(parallel_env(Config(pursuers=2)).possible_agents) == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pursuer_5": 5}, r"pursuer_5: action 5 is not in 0\.\.4"),
        ({"pursuer_5": -1}, r"pursuer_5: action -1 is not in 0\.\.4"),
        ({"pursuer_5": "north"}, "pursuer_5: 'north' is not an action number"),
        ({"pursuer_6": 0}, "actions are needed for exactly"),
    ],
)
def test_wrong_action_is_refused(change: dict[str, Any], message: str) -> None:
    """An action that does not exist is a ValueError that names the agent."""
    game = parallel_env("pursuit-n6")
    game.reset(seed=1)
    with pytest.raises(ValueError, match=message):
        game.step(dict.fromkeys(game.agents, STAY) | change)


@pytest.mark.parametrize(
    "action", [[0.5], [0.5, 0.5, 0.5], 0.5, [0.0, 1.01], [float("nan"), 0.0], "north", None]
)
def test_wrong_numbers_as_action_are_refused(action: Any) -> None:
    """An action that is not two numbers in [-1, 1] is a ValueError that names the agent."""
    game = parallel_env("waterworld-n8")
    game.reset(seed=1)
    before = game.state_dict()
    with pytest.raises(ValueError, match=r"pursuer_5: .* is not 2 numbers"):
        game.step(nothing(game) | {"pursuer_5": action})
    assert game.state_dict() == before


def test_unknown_names_are_refused() -> None:
    """An unknown environment is answered with the nearest one, an unknown mode with the known."""
    with pytest.raises(ValueError, match="did you mean 'pursuit-n6'"):
        parallel_env("pursuit_n6")
    with pytest.raises(ValueError, match=r"known: .*pursuit-n6, pursuit-n8"):
        parallel_env("chess")
    with pytest.raises(ValueError, match="render_mode must be one of"):
        parallel_env("pursuit-n6", "window")


def test_nothing_works_before_reset() -> None:
    """Before the first reset there is no game to step, read or show."""
    game = parallel_env("pursuit-n6", "ansi")
    for call in (lambda: game.step({}), game.state_dict, game.state, game.render):
        with pytest.raises(RuntimeError, match="call reset"):
            call()


def test_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without PettingZoo the import says in one line what to install."""
    monkeypatch.setitem(sys.modules, "pettingzoo", None)
    monkeypatch.delitem(sys.modules, parallel.__name__)
    with pytest.raises(ImportError, match="pettingzoo") as caught:
        importlib.import_module(parallel.__name__)
    assert "\n" not in str(caught.value)
    assert str(caught.value).endswith(to_install("pettingzoo"))
