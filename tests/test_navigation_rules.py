"""What the rules of navigation mean, from positions that a pencil can check."""

import dataclasses
import math
from typing import Any

import pytest
import torch

from msgdrop_envs.navigation.rules import PAPER, Config, Navigation
from tests.navigation_positions import EAST, FAR, NORTH, NOTHING, SOUTH, WEST, play, seen
from tests.slow_navigation import Point


@pytest.mark.parametrize("name", ["navigation-n8", "navigation-n10"])
def test_the_papers_games(name: str) -> None:
    """N = L = 8 or 10, R2- = 2 (l. 381), T = 25, 4N + 2 numbers (l. 759), everything own."""
    config = PAPER[name]
    env = Navigation(config, torch.device("cpu"))
    assert name == f"navigation-n{config.agents}"
    assert config.agents == config.landmarks == env.agents
    assert env.observation_size == 4 * config.agents + 2
    assert (config.collision_penalty, config.time_limit, config.sight) == (2.0, 25, 0.5)
    assert config.landmark_order == "fixed"


@pytest.mark.parametrize(
    ("action", "way"),
    [(NOTHING, (0, 0)), (EAST, (1, 0)), (WEST, (-1, 0)), (NORTH, (0, 1)), (SOUTH, (0, -1))],
)
def test_one_push(action: int, way: Point) -> None:
    """From rest: force 5 for 0.1 gives velocity 0.5, which moves 0.05 in the same step."""
    state, _ = play([(0.5, -0.5)], [FAR], [action])
    assert state.velocities[0].tolist() == pytest.approx([0.5 * way[0], 0.5 * way[1]])
    assert state.positions[0].tolist() == pytest.approx([0.5 + 0.05 * way[0], -0.5 + 0.05 * way[1]])


def test_a_moving_agent_is_damped_before_it_moves() -> None:
    """Velocity 2 becomes 1.5 and moves 0.15; pushed on, it stays 2: the highest speed there is."""
    state, _ = play([(0.0, 0.0), (5.0, 5.0)], [FAR], [NOTHING, EAST], [(2.0, 0.0), (2.0, 0.0)])
    assert state.velocities.tolist() == [[1.5, 0.0], [2.0, 0.0]]
    assert state.positions[:, 0].tolist() == pytest.approx([0.15, 5.2])


def test_moves_first_uses_the_old_velocity() -> None:
    """In PettingZoo's order a push from rest moves nobody yet, and velocity 2 moves 0.2."""
    state, _ = play(
        [(0.0, 0.0), (5.0, 5.0)], [FAR], [EAST, NOTHING], [(0, 0), (2, 0)], moves_first=True
    )
    assert state.positions[:, 0].tolist() == pytest.approx([0.0, 5.2])
    assert state.velocities[:, 0].tolist() == pytest.approx([0.5, 1.5])


@pytest.mark.parametrize(
    ("apart", "depth"),
    [
        (0.2, 0.1),  # deep: the softplus is a straight line
        (0.299, 1e-3 * math.log(1 + math.e)),
        (0.3, 1e-3 * math.log(2)),  # where contact begins
        (0.301, 1e-3 * math.log(1 + 1 / math.e)),
        (0.35, 0.0),  # 50 margins away
    ],
)
def test_contact_force_at_a_distance(apart: float, depth: float) -> None:
    """100 times the depth, on both, away from each other: velocity 10 times the depth."""
    state, _ = play([(0.0, 1.0), (apart, 1.0)], [FAR])
    expected = 10 * depth
    assert state.velocities[:, 0].tolist() == pytest.approx([-expected, expected], abs=1e-5)
    assert state.velocities[:, 1].tolist() == [0.0, 0.0]


def test_contact_force_is_along_the_line_between_them() -> None:
    """(0.12, 0.16) apart is 0.2: 0.1 deep, force 10, of which 0.6 and 0.8."""
    state, _ = play([(0.0, 0.0), (0.12, 0.16)], [FAR])
    assert state.velocities[1].tolist() == pytest.approx([0.6, 0.8], abs=1e-4)
    assert state.velocities[0].tolist() == pytest.approx([-0.6, -0.8], abs=1e-4)


def test_two_agents_head_on_come_to_rest_in_contact() -> None:
    """Pushing against each other they rest 0.25 apart (force 5 = 100 x 0.05) and keep paying."""
    config = Config(agents=2, landmarks=1)
    env = Navigation(config, torch.device("cpu"))
    state, transition = play([(-0.4, 0.0), (0.4, 0.0)], [(0.0, 0.0)], [EAST, WEST])
    for _ in range(60):
        state, transition = env.step(state, torch.tensor([EAST, WEST]), torch.zeros(0))
    assert state.positions[:, 0].tolist() == pytest.approx([-0.125, 0.125], abs=1e-4)
    assert transition.reward.tolist() == pytest.approx([-2.125, -2.125], abs=1e-4)


def test_agents_on_one_point_do_not_push() -> None:
    """Without a line between them there is no direction; both pay."""
    state, transition = play([(0.1, 0.2)] * 2, [(0.1, 0.2)])
    assert state.velocities.tolist() == [[0.0, 0.0]] * 2
    assert transition.reward.tolist() == [-2.0, -2.0]


# name: (agents, landmarks, changes, expected rewards, expected pairs in contact); nobody moves
REWARDS: dict[str, tuple[list[Point], list[Point], dict[str, Any], list[float], int]] = {
    "the nearest landmark counts": ([(0, 0)], [(0.3, 0.4), (0, -2)], {}, [-0.5], 0),
    "each its own, even the same": ([(0, 0), (2, 0)], [(1, 0), (5, 0)], {}, [-1, -1], 0),
    "a landmark nobody is near costs nothing": ([(0, 0)], [(0, 0), FAR], {}, [0.0], 0),
    "contact": ([(0, 0), (1, 0)], [(0, 0), (1, 0)], {"agent_radius": 0.6}, [-2, -2], 1),
    "just no contact": ([(0, 0), (1, 0)], [(0, 0), (1, 0)], {"agent_radius": 0.5}, [0, 0], 0),
    "for each other agent": (
        [(-1, 0), (0, 0), (1, 0)],
        [(-1, 0), (0, 0), (1, 0)],
        {"agent_radius": 0.75},
        [-2, -4, -2],
        2,
    ),
    "or once": (
        [(-1, 0), (0, 0), (1, 0)],
        [(-1, 0), (0, 0), (1, 0)],
        {"agent_radius": 0.75, "collision_penalty_once": True},
        [-2, -2, -2],
        2,
    ),
}


@pytest.mark.parametrize("name", REWARDS)
def test_reward(name: str) -> None:
    """Distance to the nearest landmark, and 2 for each other agent strictly nearer than touching.

    Played in PettingZoo's order, so that nobody has moved when the bill comes.
    """
    agents, landmarks, changes, rewards, pairs = REWARDS[name]
    _, transition = play(agents, landmarks, moves_first=True, **changes)
    assert transition.reward.tolist() == pytest.approx(rewards)
    assert transition.info["collisions"].item() == pairs


def test_reward_is_of_the_position_after_the_move() -> None:
    """The agent moves 0.05 towards the landmark and is paid for where it is then."""
    _, transition = play([(0.0, 0.0)], [(1.0, 0.0)], [EAST])
    assert transition.reward.tolist() == pytest.approx([-0.95])


def test_nothing_but_the_time_limit_ends_a_game() -> None:
    """Discount 1 and no end, even with every landmark covered."""
    _, transition = play([(0, 0), (1, 1)], [(0, 0), (1, 1)])
    assert (transition.discount.item(), transition.ended.item()) == (1.0, False)
    assert transition.info["covered"].item() == 2


def test_a_landmark_is_covered_once_and_strictly() -> None:
    """Two agents cover one landmark once; one at exactly the radius covers none."""
    _, transition = play([(0, 0), (0, 0)], [(0.25, 0.0), (0.5, 0.0)], cover_radius=0.5)
    assert transition.info["covered"].item() == 1


def test_observation_in_order() -> None:
    """Velocity, position, landmarks as numbered, others in increasing order: 4N + 2 numbers."""
    agents: list[Point] = [(0.0, 0.0), (0.25, 0.25), (-0.25, 0.25)]
    state, transition = play(
        agents, [(1, 0), (0, 1), (0.5, 0)], [EAST, NOTHING, NOTHING], sight=1.0
    )
    assert transition.obs.shape == (3, 14)
    assert transition.obs[:, :2].tolist() == state.velocities.tolist()
    assert transition.obs[:, 2:4].tolist() == state.positions.tolist()
    landmarks, others = seen(transition.obs, 3)
    assert landmarks == [(0.95, 0.0), (-0.05, 1.0), (0.45, 0.0)]
    assert others == [(0.2, 0.25), (-0.3, 0.25)]
    assert seen(transition.obs, 3, agent=1)[1] == [(-0.2, -0.25), (-0.5, 0.0)]


def test_others_are_seen_only_if_strictly_nearer_than_sight() -> None:
    """At exactly 0.5 an agent stands as (0, 0); landmarks are seen from anywhere."""
    agents: list[Point] = [(0.0, 0.0), (0.5, 0.0), (0.0, 0.49), (3.0, 0.0)]
    _, transition = play(agents, [FAR])
    landmarks, others = seen(transition.obs, 4)
    assert landmarks == [FAR]
    assert others == [(0.0, 0.0), (0.0, 0.49), (0.0, 0.0)]


def test_nearest_landmarks_first() -> None:
    """Each agent has an order of its own; landmarks equally far keep their numbers' order."""
    agents: list[Point] = [(0.0, 0.0), (3.0, 0.0)]
    marks: list[Point] = [(2.0, 0.0), (-1.0, 0.0), (0.0, 0.5), (1.0, 0.0)]
    _, transition = play(agents, marks, landmark_order="nearest")
    assert seen(transition.obs, 2)[0] == [(0.0, 0.5), (-1.0, 0.0), (1.0, 0.0), (2.0, 0.0)]
    assert seen(transition.obs, 2, 1)[0] == [(-1.0, 0.0), (-2.0, 0.0), (-3.0, 0.5), (-4.0, 0.0)]


def test_absolute_locations() -> None:
    """Where things are in the world; who is not seen is still (0, 0)."""
    agents: list[Point] = [(1.0, 1.0), (1.0, 1.4), (3.0, 3.0)]
    _, transition = play(agents, [(0.5, 2.0)], absolute_locations=True)
    assert seen(transition.obs, 3) == ([(0.5, 2.0)], [(1.0, 1.4), (0.0, 0.0)])


def test_games_start_at_rest_anywhere_in_the_square() -> None:
    """Uniform numbers 0, 1/2 and 3/4 are the coordinates -1, 0 and 1/2; agents come first."""
    env = Navigation(Config(agents=1, landmarks=2), torch.device("cpu"))
    state = env.reset(torch.tensor([0.0, 0.5, 0.75, 0.25, 0.5, 0.5]))
    assert state.positions.tolist() == [[-1.0, 0.0]]
    assert state.velocities.tolist() == [[0.0, 0.0]]
    assert state.landmarks.tolist() == [[0.5, -0.5], [0.0, 0.0]]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *(("agents", 0), ("landmarks", 0), ("time_limit", 0), ("sight", 0.0)),
        *(("agent_radius", -1.0), ("cover_radius", math.inf), ("collision_penalty", -2.0)),
        ("landmark_order", "sorted"),
    ],
)
def test_config_refuses_impossible_games(field: str, value: Any) -> None:
    """The message names the field and the value."""
    with pytest.raises(ValueError, match=rf"{field} must be .*, not {value}"):
        dataclasses.replace(Config(), **{field: value})
