"""What the rules of pursuit mean, from positions that a pencil can check."""

import dataclasses

import pytest
import torch

from msgdrop_envs.pursuit.rules import PAPER, Config, Pursuit
from tests.pursuit_positions import (
    EAST,
    NORTH,
    RING,
    SOUTH,
    STAY,
    WEST,
    assert_equal_state,
    play,
    position,
    slow_game,
    stack,
    uniform,
    windows,
)
from tests.slow_pursuit import Cell

# name: (pursuers, evaders, expected reward of each pursuer, expected catches); nobody moves
POSITIONS: dict[str, tuple[list[Cell], list[Cell | None], list[float], int]] = {
    "interior, four sides": ([*RING, (9, 9)], [(5, 5)], [4.95] * 4 + [-0.05], 1),
    "interior, three sides": ([*RING[:3], (9, 9)], [(5, 5)], [-0.05] * 4, 0),
    "interior, diagonals": ([(4, 4), (4, 6), (6, 4), (6, 6)], [(5, 5)], [-0.05] * 4, 0),
    "north edge, three sides": ([(0, 4), (0, 6), (1, 5)], [(0, 5)], [4.95] * 3, 1),
    "south edge, three sides": ([(14, 4), (14, 6), (13, 5)], [(14, 5)], [4.95] * 3, 1),
    "east edge, two sides": ([(4, 14), (6, 14)], [(5, 14)], [-0.05] * 2, 0),
    "corner, two sides": ([(0, 13), (1, 14), (7, 7)], [(0, 14)], [4.95, 4.95, -0.05], 1),
    "corner, one side": ([(13, 0), (9, 9)], [(14, 0)], [-0.05] * 2, 0),
    "two evaders in one cell": (RING, [(5, 5), (5, 5)], [9.95] * 4, 2),
    "two captures that share a side": (
        [*RING, (4, 7), (5, 8), (6, 7)],
        [(5, 5), (5, 7)],
        [4.95, 9.95, 4.95, 4.95, 4.95, 4.95, 4.95],
        2,
    ),
    "one of two evaders": (RING, [(5, 5), (9, 9)], [4.95] * 4, 1),
    "an evader is no side": (RING[:3], [(5, 5), (6, 5)], [-0.05] * 3, 0),
    "on the evader is no side": ([*RING[:3], (5, 5)], [(5, 5)], [-0.05] * 4, 0),
    "on a surrounded evader": ([*RING, (5, 5)], [(5, 5)], [4.95] * 4 + [-0.05], 1),
    "two pursuers stacked on one side": ([*RING, RING[0]], [(5, 5)], [4.95] * 5, 1),
    "stacked pursuers take one side": ([RING[0]] * 4, [(5, 5)], [-0.05] * 4, 0),
    "captured before": (RING, [None, (9, 9)], [-0.05] * 4, 0),
}


@pytest.mark.parametrize("name", POSITIONS)
def test_capture_and_its_reward(name: str) -> None:
    """Who is captured and who is paid, from positions that a pencil can check."""
    pursuers, evaders, rewards, catches = POSITIONS[name]
    state, transition = play(pursuers, evaders)
    free = sum(evader is not None for evader in evaders) - catches
    assert transition.reward.tolist() == pytest.approx(rewards)
    assert transition.info["catches"].item() == catches
    assert int(state.free.sum()) == free
    assert transition.discount.item() == (1.0 if free else 0.0)
    assert transition.ended.item() == (not free)


def assert_slow_game_agrees(
    pursuers: list[Cell],
    evaders: list[Cell | None],
    actions: list[int] | None = None,
    evader_moves: list[int] | None = None,
) -> None:
    """One step of the slow game gives all that one step of the batched game gives."""
    actions, moves = actions or [STAY] * len(pursuers), evader_moves or [STAY] * len(evaders)
    state, transition = play(pursuers, evaders, actions, moves)
    game = slow_game(Config(), pursuers, evaders)
    outcome = game.step(actions, [uniform(move) for move in moves])
    assert_equal_state(stack([state]), [game])
    assert outcome.rewards == pytest.approx(transition.reward.tolist())
    assert outcome.discount == transition.discount.item()
    assert outcome.catches == transition.info["catches"].item()
    assert outcome.observations == transition.obs.tolist()


@pytest.mark.parametrize("name", POSITIONS)
def test_slow_game_agrees_from_hand_made_positions(name: str) -> None:
    """The slow game agrees with the pencil's numbers, state and discount included."""
    pursuers, evaders, _, _ = POSITIONS[name]
    assert_slow_game_agrees(pursuers, evaders)


def test_capture_reward_once_pays_two_captures_once() -> None:
    """With MADRL's rule two evaders captured together still count twice but pay once."""
    _, transition = play(RING, [(5, 5), (5, 5)], capture_reward_once=True)
    assert transition.reward.tolist() == pytest.approx([4.95] * 4)
    assert transition.info["catches"].item() == 2


def test_boxed_in_evader_cannot_flee() -> None:
    """The last pursuer arrives in the corner's free side, just where the evader wants to go."""
    boxed_in: list[Cell | None] = [(0, 0)]
    state, transition = play([(0, 1), (2, 0)], boxed_in, [STAY, NORTH], [SOUTH])
    assert state.pursuers.tolist() == [[0, 1], [1, 0]]
    assert transition.reward.tolist() == pytest.approx([4.95, 4.95])
    assert transition.discount.item() == 0
    assert_slow_game_agrees([(0, 1), (2, 0)], boxed_in, [STAY, NORTH], [SOUTH])


def test_evader_walks_into_a_pocket() -> None:
    """An evader that steps between four pursuers is captured in the same step."""
    state, transition = play(
        [(4, 5), (5, 6), (5, 3), (6, 5)], [(5, 4)], [STAY, STAY, EAST, STAY], [EAST]
    )
    assert not state.free.any()
    assert transition.reward.tolist() == pytest.approx([4.95] * 4)


def test_evader_sees_pursuers_after_their_move() -> None:
    """A pursuer's new cell blocks an evader, the cell it just left does not."""
    blocked, _ = play([(5, 7)], [(5, 5)], [WEST], [EAST])
    assert blocked.evaders.tolist() == [[5, 5]]
    followed, _ = play([(5, 6)], [(5, 5)], [EAST], [EAST])
    assert followed.evaders.tolist() == [[5, 6]]


@pytest.mark.parametrize("move", range(5))
def test_moves_of_pursuers_and_evaders(move: int) -> None:
    """North, East, West, South, Stay, for a pursuer's action and for an evader's number."""
    down, right = [(-1, 0), (0, 1), (0, -1), (1, 0), (0, 0)][move]
    state, _ = play([(7, 3)], [(7, 11)], [move], [move])
    assert state.pursuers.tolist() == [[7 + down, 3 + right]]
    assert state.evaders.tolist() == [[7 + down, 11 + right]]


@pytest.mark.parametrize(
    ("cell", "move"), [((0, 7), NORTH), ((7, 14), EAST), ((7, 0), WEST), ((14, 7), SOUTH)]
)
def test_edge_stops_everybody_and_costs_the_pursuer(cell: Cell, move: int) -> None:
    """A move off the map keeps pursuer and evader in place; the pursuer pays 0.5 on top."""
    state, transition = play([cell, (3, 3)], [cell], [move, STAY], [move])
    assert state.pursuers[0].tolist() == list(cell)
    assert state.evaders[0].tolist() == list(cell)
    assert transition.reward.tolist() == pytest.approx([-0.55, -0.05])
    assert transition.info["edge_hits"].item() == 1


def test_pursuer_may_enter_an_evader_or_not() -> None:
    """An evader's cell is open by default; with the option the pursuer stays, at no extra cost."""
    entered, _ = play([(5, 4)], [(5, 5)], [EAST])
    assert entered.pursuers.tolist() == [[5, 5]]
    kept_out, transition = play([(5, 4)], [(5, 5)], [EAST], may_enter_evaders=False)
    assert kept_out.pursuers.tolist() == [[5, 4]]
    assert transition.reward.tolist() == pytest.approx([-0.05])


def test_pursuers_may_share_a_cell_or_not() -> None:
    """A pursuer's cell is open by default; with the option the second to come stays, unfined."""
    meeting: list[Cell] = [(5, 4), (5, 6)]
    shared, _ = play(meeting, [(9, 9)], [EAST, WEST])
    assert shared.pursuers.tolist() == [[5, 5], [5, 5]]
    apart, transition = play(meeting, [(9, 9)], [EAST, WEST], may_share_cells=False)
    assert apart.pursuers.tolist() == [[5, 5], [5, 6]]
    assert transition.reward.tolist() == pytest.approx([-0.05] * 2)


def test_pursuers_that_share_no_cell_move_in_the_order_of_their_numbers() -> None:
    """A row follows its head if that moves first; two never pass through each other."""
    row: list[Cell] = [(5, 5), (5, 4), (5, 3)]
    followed, _ = play(row, [(9, 9)], [EAST] * 3, may_share_cells=False)
    assert followed.pursuers.tolist() == [[5, 6], [5, 5], [5, 4]]
    stuck, _ = play(row[::-1], [(9, 9)], [EAST] * 3, may_share_cells=False)
    assert stuck.pursuers.tolist() == [[5, 3], [5, 4], [5, 6]]
    swapped, _ = play(row[:2], [(9, 9)], [WEST, EAST], may_share_cells=False)
    assert swapped.pursuers.tolist() == [[5, 5], [5, 4]]


def test_pursuers_that_share_no_cell_start_apart_and_anywhere() -> None:
    """No two of 9 on 9 cells meet, and each takes every cell equally often."""
    env = Pursuit(Config(pursuers=9, map_size=3, may_share_cells=False), torch.device("cpu"))
    uniforms = torch.rand(9_000, 9, generator=torch.Generator().manual_seed(6))
    cells = env.reset(uniforms).pursuers @ torch.tensor([3, 1])
    assert torch.equal(cells.sort(-1).values, torch.arange(9).expand(9_000, 9))
    counts = torch.stack([cells[:, pursuer].bincount(minlength=9) for pursuer in range(9)])
    assert counts.sub(1_000).abs().max() < 150  # five standard deviations


def test_captured_evader_is_in_nobodys_way() -> None:
    """Where an evader was captured, a pursuer may walk and sees nothing."""
    state = position([(5, 4)], [None, (9, 9)])
    state = dataclasses.replace(state, evaders=torch.tensor([[5, 5], [9, 9]]))
    env = Pursuit(Config(pursuers=1, may_enter_evaders=False), torch.device("cpu"))
    state, transition = env.step(state, torch.tensor([EAST]), torch.tensor([0.9, 0.9]))
    assert state.pursuers.tolist() == [[5, 5]]
    assert not transition.obs[0, 49:98].any()


def test_window_shows_others_and_evaders_where_they_are() -> None:
    """Never myself, everybody else up to three cells away, counted; no one further off."""
    pursuers = [(7, 7), (7, 7), (4, 10), (3, 7)]
    _, transition = play(pursuers, [(10, 4), (10, 4)])
    assert windows(transition.obs[0]) == {(0, 3, 3): 1, (0, 0, 6): 1, (1, 6, 0): 2}
    assert windows(transition.obs[3]) == {(0, 4, 6): 1}


def test_window_shows_the_edge() -> None:
    """From the corner (0, 0) three rows and three columns of the window lie off the map."""
    _, transition = play([(0, 0)], [(9, 9)])
    edge = transition.obs[0].view(3, 7, 7)[2]
    assert edge.sum().item() == 49 - 16
    assert not edge[3:, 3:].any()


def test_extreme_uniform_numbers_stay_on_the_map() -> None:
    """0 and the largest float32 below 1 pick the first and the last cell, and the last move."""
    for config in PAPER.values():
        env = Pursuit(config, torch.device("cpu"))
        below_one = 1 - 2.0**-24
        numbers = torch.tensor([0.0, below_one] * (config.pursuers // 2))
        state = env.reset(numbers)
        last = config.map_size - 1
        assert state.pursuers[:2].tolist() == [[0, 0], [last, last]]
        assert state.evaders.tolist() == [[last // 2, last // 2]] * config.evaders
        actions = torch.full((config.pursuers,), STAY)
        after, _ = env.step(state, actions, torch.tensor([0.0, below_one]))
        assert (after.evaders - state.evaders).tolist() == [[-1, 0], [0, 0]]  # North, Stay


@pytest.mark.parametrize(
    ("field", "value"),
    [("pursuers", 0), ("evaders", 0), ("sight", 0), ("time_limit", 0), ("map_size", 2)],
)
def test_config_refuses_impossible_games(field: str, value: int) -> None:
    """The message names the field and the value."""
    with pytest.raises(ValueError, match=rf"{field} must be at least \d, not {value}"):
        Config(**{field: value})  # type: ignore[arg-type]  # no bool field is listed
