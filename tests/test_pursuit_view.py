"""One game of pursuit as plain lists, text and picture, and which positions are refused."""

from typing import Any

import numpy as np
import pytest

from msgdrop_envs.parallel import parallel_env
from msgdrop_envs.pursuit.rules import Config
from msgdrop_envs.pursuit.view import PursuitView

RING = [[4, 5], [5, 6], [5, 4], [6, 5], [0, 0], [14, 14]]
"""Six pursuers: four of them around (5, 5)."""


def test_state_vector_holds_all_positions() -> None:
    """`state()`: pursuers, evaders, and who is free, in this order."""
    game = parallel_env(Config(pursuers=1))
    game.reset(options={"state": {"pursuers": [[1, 2]], "evaders": [[3, 4], [5, 6]]}})
    assert game.state().tolist() == [1, 2, 3, 4, 5, 6, 1, 1]


def test_text_of_pursuit() -> None:
    """Pursuers by number, evaders as E, who shares a cell side by side; captured ones are gone."""
    game = parallel_env(Config(pursuers=3, evaders=3, map_size=3), "ansi")
    state = {"pursuers": [[0, 2], [1, 1], [2, 0]], "evaders": [[1, 1], None, [0, 0]]}
    game.reset(options={"state": state})
    expected = """
+----------+
|  E  .  0 |
|  . E1  . |
|  2  .  . |
+----------+
2 of 3 evaders free"""
    assert game.render() == expected.strip()


def test_picture_of_pursuit() -> None:
    """Blue where the pursuer is, orange where the evader is, tinted where the pursuer sees."""
    game = parallel_env(Config(pursuers=1, evaders=2, map_size=9), "rgb_array")
    game.reset(options={"state": {"pursuers": [[1, 1]], "evaders": [[7, 6], None]}})
    picture = game.render()
    assert isinstance(picture, np.ndarray)
    assert picture.shape == (9 * 42 + 12, 9 * 42 + 12, 3)

    def at(row: int, column: int, down: int = 21, right: int = 21) -> list[int]:
        pixel: list[int] = picture[6 + row * 42 + down, 6 + column * 42 + right].tolist()
        return pixel

    assert at(7, 6) == [222, 106, 16]
    assert at(1, 1, right=8) == [0, 98, 158]  # left of the number
    assert at(4, 4) == [227, 237, 246]
    assert at(5, 5) == at(1, 5) == [250, 250, 247]


def pieces(picture: np.ndarray[Any, Any]) -> int:
    """How many separate things stand on the tinted ground of a picture."""
    drawn = {tuple(at) for at in np.argwhere((picture != (227, 237, 246)).any(-1)).tolist()}
    count = 0
    while drawn:
        count += 1
        edge = [drawn.pop()]
        while edge:
            row, column = edge.pop()
            sides = {(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)}
            edge += sides & drawn
            drawn -= sides
    return count


@pytest.mark.parametrize("crowd", [1, 2, 4, 5, 9, 12])
def test_crowded_cells_can_be_drawn(crowd: int) -> None:
    """Any number of players on one cell of the corner has its place in text and picture."""
    state = {"pursuers": [[14, 14]] * crowd, "evaders": [[14, 14]]}
    shown: dict[str, Any] = {}
    for mode in ("rgb_array", "ansi"):
        game = parallel_env(Config(pursuers=crowd, evaders=1), mode)
        game.reset(options={"state": state})
        shown[mode] = game.render()
    assert "E" + "".join(map(str, range(crowd))) in shown["ansi"]
    last = 6 + 14 * 42
    cell = shown["rgb_array"][last + 1 : last + 42, last + 1 : last + 42]  # without its grid lines
    assert pieces(cell) == crowd + 1
    for colour in ((222, 106, 16), (0, 98, 158)):
        assert (cell == colour).all(-1).any()
    assert (shown["rgb_array"][:last, :last] != (222, 106, 16)).any(-1).all()  # and nowhere else


WRONG_STATES: dict[str, tuple[Any, str]] = {
    "no mapping": ([[1, 2]], "exactly 'pursuers' and 'evaders'"),
    "a key missing": ({"pursuers": RING}, "exactly 'pursuers' and 'evaders'"),
    "a key too many": (
        {"pursuers": RING, "evaders": [[1, 1], None], "time": 3},
        "exactly 'pursuers' and 'evaders'",
    ),
    "too few pursuers": (
        {"pursuers": RING[:5], "evaders": [[1, 1], None]},
        "pursuers must be a list of 6 positions",
    ),
    "too many evaders": (
        {"pursuers": RING, "evaders": [[1, 1]] * 3},
        "evaders must be a list of 2 positions",
    ),
    "evaders as text": ({"pursuers": RING, "evaders": "ab"}, "evaders must be a list of 2"),
    "captured pursuer": (
        {"pursuers": [None, *RING[1:]], "evaders": [[1, 1], None]},
        "pursuer's position cannot be null",
    ),
    "nobody left": ({"pursuers": RING, "evaders": [None, None]}, "at least one evader"),
    "off the map": (
        {"pursuers": [[15, 0], *RING[1:]], "evaders": [[1, 1], None]},
        r"\[15, 0\] is off the 15 x 15 map",
    ),
    "negative": (
        {"pursuers": RING, "evaders": [[0, -1], None]},
        r"\[0, -1\] is off the 15 x 15 map",
    ),
    "half a cell": ({"pursuers": RING, "evaders": [[0.5, 1], None]}, r"is not \[row, col\]"),
    "three numbers": ({"pursuers": RING, "evaders": [[1, 1, 1], None]}, r"is not \[row, col\]"),
    "one number": ({"pursuers": RING, "evaders": [3, None]}, r"is not \[row, col\]"),
    "true and false": ({"pursuers": RING, "evaders": [[True, 1], None]}, r"is not \[row, col\]"),
}


@pytest.mark.parametrize("name", WRONG_STATES)
def test_wrong_state_is_refused(name: str) -> None:
    """A position that cannot be is a ValueError that says why, and leaves the game as it was."""
    state, message = WRONG_STATES[name]
    game = parallel_env("pursuit-n6")
    game.reset(seed=1)
    before = game.state_dict()
    with pytest.raises(ValueError, match=message):
        game.reset(options={"state": state})
    assert game.state_dict() == before


def test_a_shared_cell_is_refused_where_none_may_be() -> None:
    """By default pursuers may be stacked; where they may not, no game starts so."""
    stacked = {"pursuers": [[4, 5], [4, 5]], "evaders": [[1, 1]]}
    PursuitView(Config(pursuers=2, evaders=1)).state_from_dict(stacked)
    view = PursuitView(Config(pursuers=2, evaders=1, may_share_cells=False))
    with pytest.raises(ValueError, match="two pursuers stand in one cell"):
        view.state_from_dict(stacked)
