"""One game of navigation as plain lists, text and picture, and which positions are refused."""

from typing import Any

import numpy as np
import pytest

from msgdrop_envs.navigation.rules import Config
from msgdrop_envs.parallel import parallel_env

TWO = Config(agents=2, landmarks=2)
AT_REST = [[0.0, 0.0], [0.0, 0.0]]
APART: dict[str, Any] = {
    "positions": [[-0.5, 0.0], [0.5, 0.0]],
    "velocities": AT_REST,
    "landmarks": [[0.0, 0.75], [0.0, -0.75]],
}
CLOSE: dict[str, Any] = {**APART, "positions": [[0.0, 0.72], [0.2, 0.72]]}


def test_state_vector_holds_everything() -> None:
    """`state()`: positions, velocities and landmarks, in this order."""
    game = parallel_env(TWO)
    game.reset(options={"state": {**APART, "velocities": [[1, 2], [3, 4]]}})
    assert game.state().tolist() == [-0.5, 0, 0.5, 0, 1, 2, 3, 4, 0, 0.75, 0, -0.75]


def test_names() -> None:
    """Agents by number, the name of the setting with the version."""
    game = parallel_env("navigation-n8")
    assert game.possible_agents == [f"agent_{number}" for number in range(8)]
    assert game.metadata["name"] == "navigation_n8_v0"


def test_infos_count_the_whole_game() -> None:
    """Pairs in contact and landmarks covered as they are after the step, in any step."""
    game = parallel_env(TWO)
    game.reset(options={"state": {**APART, "positions": [[0.0, 0.75], [0.28, 0.75]]}})
    *_, infos = game.step({"agent_0": 1, "agent_1": 2})
    assert infos["agent_0"] == infos["agent_1"] == {"collisions": 1.0, "covered": 1.0}


def test_text_of_navigation() -> None:
    """+y is up; landmarks are `x`, agents their numbers; the last line counts."""
    game = parallel_env(TWO, "ansi")
    game.reset(options={"state": APART})
    text = game.render()
    assert isinstance(text, str)
    rows = [line[1:-1].split() for line in text.splitlines()[1:-2]]
    assert len(rows) == len(rows[0]) == 21
    held = {(r, c): text for r, row in enumerate(rows) for c, text in enumerate(row) if text != "."}
    assert held == {(4, 10): "x", (10, 6): "0", (10, 14): "1", (16, 10): "x"}
    assert text.endswith("0 of 2 landmarks covered, 0 pairs in contact")


def test_picture_of_navigation() -> None:
    """Agents blue, red-rimmed in contact; landmarks orange, green when covered; sight is tinted."""
    game = parallel_env(TWO, "rgb_array")

    def colour(state: Any, x: float, y: float) -> list[int]:
        game.reset(options={"state": state})
        picture = game.render()
        assert isinstance(picture, np.ndarray)
        assert picture.shape == (642, 642, 3)
        scale = 630 / 2.45  # 1 and three quarters of an agent's width to each side
        pixel: list[int] = picture[
            6 + int((1.225 - y) * scale), 6 + int((1.225 + x) * scale)
        ].tolist()
        return pixel

    blue, red, orange, green = [0, 98, 158], [190, 30, 45], [222, 106, 16], [38, 134, 74]
    assert colour(APART, -0.5, 0.1) == blue
    assert colour(APART, -0.5, 0.3) == [227, 237, 246]
    assert colour(APART, -0.9, 0.9) == [250, 250, 247]
    assert colour(APART, 0.0, 0.75) == colour(CLOSE, 0.0, -0.75) == orange
    assert colour(CLOSE, 0.0, 0.75) == green
    assert colour(APART, -0.5, 0.145) == blue
    assert colour(CLOSE, 0.0, 0.865) == red


def test_everybody_is_shown_however_far_out() -> None:
    """The world that is shown grows with who has left it, until numbers no longer fit."""
    for far in (1.5, 40.0, 1e6):
        state = {**APART, "positions": [[-far, far], [0.0, 0.0]]}
        for mode in ("rgb_array", "ansi"):
            game = parallel_env(TWO, mode)
            game.reset(options={"state": state})
            shown = game.render()
            assert "0" in shown if isinstance(shown, str) else shown is not None


WRONG_STATES: dict[str, tuple[Any, str]] = {
    "no mapping": ([[1, 2]], "exactly positions, velocities, landmarks"),
    "a key missing": ({"positions": AT_REST}, "exactly positions, velocities, landmarks"),
    "a key too many": ({**APART, "time": 3}, "exactly positions, velocities, landmarks"),
    "too few agents": ({**APART, "positions": [[0, 0]]}, "positions must be a list of 2 points"),
    "too many landmarks": ({**APART, "landmarks": AT_REST * 2}, "landmarks must be a list of 2"),
    "text": ({**APART, "velocities": "ab"}, "velocities must be a list of 2 points"),
    "one number": ({**APART, "positions": [1, [0, 0]]}, r"is not \[x, y\]"),
    "three numbers": ({**APART, "positions": [[0, 0, 0], [0, 0]]}, r"is not \[x, y\]"),
    "null": ({**APART, "positions": [None, [0, 0]]}, r"is not \[x, y\]"),
    "a truth": ({**APART, "positions": [[True, 0], [0, 0]]}, r"is not \[x, y\]"),
    "numbers as text": ({**APART, "positions": [["1", "2"], [0, 0]]}, r"is not \[x, y\]"),
    "not a number": ({**APART, "landmarks": [[float("nan"), 0], [0, 0]]}, "is not finite"),
    "too large": ({**APART, "landmarks": [[1e39, 0], [0, 0]]}, "is not finite"),
}


@pytest.mark.parametrize("name", WRONG_STATES)
def test_wrong_state_is_refused(name: str) -> None:
    """A position that cannot be is a ValueError that says why, and leaves the game as it was."""
    state, message = WRONG_STATES[name]
    game = parallel_env(TWO)
    game.reset(seed=1)
    before = game.state_dict()
    with pytest.raises(ValueError, match=message):
        game.reset(options={"state": state})
    assert game.state_dict() == before
