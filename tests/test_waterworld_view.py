"""One game of waterworld as plain lists, text and picture, and which states are refused."""

import copy
from typing import Any

import numpy as np
import pytest

from msgdrop_envs.parallel import parallel_env
from msgdrop_envs.waterworld.config import Config

SMALL = Config(pursuers=2, catchers=2, food=1, poison=1)
STATE: dict[str, Any] = {
    "pursuers": {"positions": [[0.25, 0.75], [0.75, 0.25]], "velocities": [[0, 0], [0.5, 0]]},
    "food": {"positions": [[0.1, 0.1]], "velocities": [[0.0, 0.0]]},
    "poison": {"positions": [[1.0, 1.0]], "velocities": [[0.0, -0.25]]},
}


def test_state_vector_holds_positions_then_velocities() -> None:
    """`state()`: all places, then all velocities; pursuers, food, poison."""
    game = parallel_env(SMALL)
    game.reset(options={"state": STATE})
    expected = [0.25, 0.75, 0.75, 0.25, 0.1, 0.1, 1, 1, 0, 0, 0.5, 0, 0, 0, 0, -0.25]
    assert game.state().tolist() == pytest.approx(expected)


def test_actions_are_two_numbers() -> None:
    """A Box from -1 to 1; the game moves as told and says what happened."""
    game = parallel_env(SMALL)
    assert str(game.action_space("pursuer_0")) == "Box(-1.0, 1.0, (2,), float32)"
    game.reset(options={"state": STATE})
    _, rewards, terminations, truncations, infos = game.step(
        {"pursuer_0": [1.0, 0.0], "pursuer_1": np.array([0.0, -1.0])}
    )
    pursuers = game.state_dict()["pursuers"]
    assert pursuers["positions"] == [pytest.approx([0.26, 0.75]), pytest.approx([1.0, 0.24])]
    assert pursuers["velocities"] == [pytest.approx([0.01, 0]), pytest.approx([0, -0.01])]
    assert rewards == pytest.approx({"pursuer_0": -5e-5, "pursuer_1": -5e-5})
    assert infos["pursuer_0"] == {"catches": 0.0, "touches": 0.0, "poison_met": 0.0}
    assert not any((*terminations.values(), *truncations.values()))


def test_text_of_waterworld() -> None:
    """North is up: pursuers by number, food, poison and the obstacle; several are a star."""
    game = parallel_env(SMALL, "ansi")
    game.reset(options={"state": STATE})
    text = game.render()
    assert isinstance(text, str)
    lines = text.splitlines()
    assert len(lines) == 28
    assert (lines[1][-2], lines[7][13], lines[19][38], lines[23][6]) == ("x", "0", "1", "F")
    assert lines[13][26] == "#"
    together = copy.deepcopy(STATE)
    together["pursuers"]["positions"] = [[0.25, 0.75]] * 2
    game.reset(options={"state": together})
    text = game.render()
    assert isinstance(text, str)
    assert text.splitlines()[7][13] == "*"


def test_picture_of_waterworld() -> None:
    """Blue pursuers with thin sensors, orange food, purple poison, a grey obstacle; north is up."""
    game = parallel_env(SMALL, "rgb_array")
    game.reset(options={"state": STATE})
    picture = game.render()
    assert isinstance(picture, np.ndarray)
    assert picture.shape == (732, 732, 3)

    def at(x: float, y: float) -> list[int]:
        pixel: list[int] = picture[6 + int((1 - y) * 720), 6 + int(x * 720)].tolist()
        return pixel

    assert at(0.235, 0.75) == [0, 98, 158]  # left of the number
    assert at(0.1, 0.1) == at(0.1, 0.137) == [222, 106, 16]
    assert at(0.99, 0.995) == [102, 45, 120]
    assert at(0.5, 0.5) == at(0.31, 0.5) == [150, 150, 152]
    assert at(0.7, 0.9) == at(0.1, 0.145) == [250, 250, 247]
    assert at(0.9, 0.25)[0] < 240  # the sensor to the east
    assert at(0.91, 0.25) == [250, 250, 247]


def changed(*path: Any, to: Any) -> dict[str, Any]:
    """The state with one thing changed."""
    state = copy.deepcopy(STATE)
    inner: Any = state
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = to
    return state


WRONG_STATES: dict[str, tuple[Any, str]] = {
    "no mapping": ([[1, 2]], "exactly 'pursuers', 'food', 'poison'"),
    "a key too many": (STATE | {"time": 3}, "exactly 'pursuers', 'food', 'poison'"),
    "a kind without parts": (
        changed("food", to=[[0.1, 0.1]]),
        "food must hold exactly 'positions'",
    ),
    "too many": (
        changed("food", "positions", to=[[0.1, 0.1]] * 2),
        "food: positions must be a list of 1 pairs",
    ),
    "text": (changed("food", "positions", to="a"), "food: positions must be a list of 1 pairs"),
    "three numbers": (changed("food", "positions", 0, to=[0, 0, 0]), r"is not \[x, y\]"),
    "one number": (changed("food", "positions", 0, to=0.5), r"is not \[x, y\]"),
    "letters": (changed("food", "positions", 0, to="12"), r"is not \[x, y\]"),
    "true": (changed("food", "positions", 0, to=[True, 0.5]), r"is not \[x, y\]"),
    "outside": (changed("poison", "positions", 0, to=[1.01, 0.5]), "is not within 0 to 1"),
    "not a number": (changed("poison", "positions", 0, 1, to=float("nan")), "not within 0 to 1"),
    "too fast": (changed("pursuers", "velocities", 1, to=[0, -2.0]), "is not within -1 to 1"),
}


@pytest.mark.parametrize("name", WRONG_STATES)
def test_wrong_state_is_refused(name: str) -> None:
    """A state that cannot be is a ValueError that says why, and leaves the game as it was."""
    state, message = WRONG_STATES[name]
    game = parallel_env(SMALL)
    game.reset(seed=1)
    before = game.state_dict()
    with pytest.raises(ValueError, match=message):
        game.reset(options={"state": state})
    assert game.state_dict() == before


def test_observations_stay_within_their_space() -> None:
    """The fastest that there can be, head on, still fits."""
    game = parallel_env(SMALL)
    fastest = changed(
        "pursuers", to={"positions": [[0.1, 0.9]] * 2, "velocities": [[1, 1], [-1, -1]]}
    )
    obs, _ = game.reset(options={"state": fastest})
    for agent in game.agents:
        assert abs(obs[agent]).max() > 100
        assert game.observation_space(agent).contains(obs[agent])
