"""What the rules of waterworld mean, from positions that a pencil can check."""

import dataclasses
from typing import Any

import pytest
import torch

from msgdrop_envs.waterworld.config import PAPER, Config
from tests.slow_waterworld import Vector
from tests.waterworld_positions import FAR, at_rest, build, params, play, state_of

CALM = {"action_penalty": 0.0}


def crew(food: Vector, *distances: float, poison: Vector = FAR) -> list[tuple[Vector, Vector]]:
    """Resting pursuers this far west of one food, the food, and one poison."""
    return at_rest(*((food[0] - d, food[1]) for d in distances), food, poison)


def test_the_papers_games() -> None:
    """N=8, K=4 and N=10, K=5 with the rewards of the paper (l. 394)."""
    eight, ten = PAPER["waterworld-n8"], PAPER["waterworld-n10"]
    assert (eight.pursuers, eight.catchers) == (8, 4)
    assert (ten.pursuers, ten.catchers) == (10, 5)
    assert dataclasses.replace(ten, pursuers=8, catchers=4) == eight
    assert (eight.food, eight.poison, eight.time_limit, eight.sensors) == (10, 10, 500, 25)
    assert (eight.catch_reward, eight.touch_reward, eight.poison_penalty) == (10.0, 0.01, 0.1)


def test_catch_needs_enough_pursuers_and_pays_those_who_touch() -> None:
    """Three of four needed pursuers get 0.01 each; the fourth makes it 10.01 for all four."""
    config = params(pursuers=5, catchers=4, **CALM)
    _, three = play(config, crew((0.5, 0.5), 0.0, 0.03, 0.0599, 0.07, 0.3))
    assert three.reward.tolist() == pytest.approx([0.01] * 3 + [0] * 2)
    assert {n: c.item() for n, c in three.info.items()} == {
        "catches": 0,
        "touches": 3,
        "poison_met": 0,
    }
    _, four = play(config, crew((0.5, 0.5), 0.0, 0.03, 0.05, 0.0599, 0.3))
    assert four.reward.tolist() == [0] * 5  # the state was one of a catch: the food is replaced
    moving = crew((0.5, 0.5), 0.0, 0.03, 0.05, 0.065, 0.3)
    moving[3] = (moving[3][0], (0.01, 0.0))
    _, caught = play(config, moving)
    assert caught.reward.tolist() == pytest.approx([10.01] * 4 + [0])
    assert {n: c.item() for n, c in caught.info.items()} == {
        "catches": 1,
        "touches": 4,
        "poison_met": 0,
    }


def test_caught_food_is_seen_and_then_replaced() -> None:
    """The state of a catch still holds the food; the next step puts it somewhere else, unpaid."""
    config = params(catchers=1, obstacle_radius=0.2, **CALM)
    env = build(config)
    discs = [((0.1, 0.1), (0.0, 0.0)), ((0.165, 0.1), (-0.006, 0.0)), *at_rest((0.9, 0.9))]
    state, first = play(config, discs)
    assert first.info["catches"].item() == 1
    assert state.positions[1].tolist() == pytest.approx([0.159, 0.1])
    numbers = torch.tensor([0.5 / 4, 0.5, 0.75, 0.25, *[0.5] * 4])
    state, second = env.step(state, torch.zeros(1, 2), numbers)
    east = 0.5 + ((0.28**2 + 0.25) / 2) ** 0.5  # due east, half the free area on either side
    assert state.positions[1].tolist() == pytest.approx([east + 0.0025, 0.5 - 0.0025])
    assert state.velocities[1].tolist() == pytest.approx([0.0025, -0.0025])
    assert (second.reward.tolist(), second.info["touches"].item()) == ([0.0], 0)


def test_poison_is_met_by_one_and_costs_everyone_who_touches() -> None:
    """0.1 for each pursuer on it, one poison met; it is replaced in the next step."""
    config = params(pursuers=2, catchers=2, **CALM)
    discs = crew((0.3, 0.9), 0.2, 0.2, poison=(0.2, 0.5))
    discs[0], discs[1] = ((0.16, 0.5), (0.006, 0.0)), ((0.2, 0.54), (0.0, -0.006))
    state, transition = play(config, discs)
    assert transition.reward.tolist() == pytest.approx([-0.1] * 2)
    assert transition.info["poison_met"].item() == 1
    assert state.positions[3].tolist() == pytest.approx([0.2, 0.5])
    after, later = build(config).step(state, torch.zeros(2, 2), torch.full((8,), 0.1))
    assert (after.positions[3] - state.positions[3]).norm() > 0.1
    assert later.info["poison_met"].item() == 0


@pytest.mark.parametrize(("once", "expected"), [(True, 10.01), (False, 20.02)])
def test_each_kind_of_reward_is_paid_once_or_for_each(once: bool, expected: float) -> None:
    """Two foods caught by one pursuer in one step are two catches."""
    config = params(food=2, rewards_once=once, **CALM)
    discs = [((0.5, 0.2), (0.0, 0.0)), ((0.57, 0.2), (-0.02, 0.0)), ((0.43, 0.2), (0.02, 0.0))]
    _, transition = play(config, [*discs, *at_rest((0.9, 0.9))])
    assert transition.reward.tolist() == pytest.approx([expected])
    assert transition.info["catches"].item() == 2
    assert transition.info["touches"].item() == 1


def test_action_costs_its_square() -> None:
    """5e-5 x |a|^2, each pursuer its own."""
    config = params(pursuers=2)
    discs = crew((0.9, 0.5), 0.4, 0.6)
    _, transition = play(config, discs, [(1.0, -1.0), (0.5, 0.0)])
    assert transition.reward.tolist() == pytest.approx([-1e-4, -1.25e-5])


def test_pursuer_accelerates_without_friction() -> None:
    """Velocity grows by 0.01 x action and moves the pursuer in the same step; then it glides."""
    config = params()
    discs = crew((0.9, 0.9), 0.5)
    state, _ = play(config, discs, [(0.5, -1.0)])
    assert state.velocities[0].tolist() == pytest.approx([0.005, -0.01])
    assert state.positions[0].tolist() == pytest.approx([0.405, 0.89])
    state, _ = build(config).step(state, torch.zeros(1, 2), torch.zeros(8))
    assert state.velocities[0].tolist() == pytest.approx([0.005, -0.01])
    assert state.positions[0].tolist() == pytest.approx([0.41, 0.88])


def test_walls_stop_pursuers_and_turn_the_rest_axis_by_axis() -> None:
    """Nobody leaves the square; the velocity along the wall stays."""
    away: Vector = (0.02, 0.03)
    discs = [((0.99, 0.5), away), ((0.99, 0.3), away), ((0.5, 0.98), away)]
    state, _ = play(params(), discs)
    expected = [[1.0, 0.53], [1.0, 0.33], [0.52, 1.0]]
    assert state.positions.tolist() == [pytest.approx(place) for place in expected]
    turned = [[0.0, 0.03], [-0.02, 0.03], [0.02, -0.03]]
    assert state.velocities.tolist() == [pytest.approx(velocity) for velocity in turned]


def test_walls_stop_objects_if_asked() -> None:
    """They stay at the wall from then on, and glide along it."""
    away: Vector = (0.02, 0.03)
    discs = [((0.2, 0.2), (0.0, 0.0)), ((0.99, 0.3), away), ((0.5, 0.98), away)]
    config = params(object_walls="stop")
    state, _ = play(config, discs)
    state, _ = build(config).step(state, torch.zeros(1, 2), torch.zeros(8))
    expected = [[1.0, 0.36], [0.54, 1.0]]
    assert state.positions[1:].tolist() == [pytest.approx(place) for place in expected]
    assert state.velocities[1:].tolist() == [pytest.approx([0.0, 0.03]), pytest.approx([0.02, 0.0])]


@pytest.mark.parametrize(("bounce", "factor"), [("half", -0.5), ("full", -1.0)])
def test_obstacle_turns_velocities_and_moves_nobody(bounce: Any, factor: float) -> None:
    """Pursuers and food keep half of their velocity, poison all; contact is radius + 0.2."""
    config = params(obstacle_radius=0.2, food_bounce=bounce)
    slow: Vector = (0.01, 0.0)
    discs = [((0.5 - 0.229, 0.5), slow), ((0.5 - 0.249, 0.5), slow), ((0.5 - 0.224, 0.5), slow)]
    pursuer, food, poison = discs
    far = [((0.1, y), (0.0, 0.0)) for y in (0.1, 0.5, 0.9)]
    for place, disc, expected in ((0, pursuer, -0.5), (1, food, factor), (2, poison, -1.0)):
        given = [disc if place == i else other for i, other in enumerate(far)]
        state, _ = play(config, given)
        assert state.positions[place, 0].item() == pytest.approx(disc[0][0] + 0.01)
        assert state.velocities[place].tolist() == pytest.approx([0.01 * expected, 0.0])
        given[place] = ((disc[0][0] - 0.002, 0.5), slow)  # ends just outside
        state, _ = play(config, given)
        assert state.velocities[place].tolist() == pytest.approx([0.01, 0.0])


@pytest.mark.parametrize(("walls", "least", "most"), [("turn", 0.5, 1.5), ("stop", 9.0, 14.0)])
def test_how_many_objects_are_at_a_wall(walls: Any, least: float, most: float) -> None:
    """Of 20, in the middle of an episode of random play: about 1 turning back, about 11 stopping.

    Figure 2c shows 4 (PAPER.md). At a wall: the centre is within 0.01 of it.
    """
    env = build(dataclasses.replace(PAPER["waterworld-n8"], object_walls=walls))
    generator = torch.Generator().manual_seed(3)
    state = env.reset(torch.rand(50, env.reset_uniforms, generator=generator))
    for _ in range(250):
        actions = torch.rand(50, 8, 2, generator=generator) * 2 - 1
        uniforms = torch.rand(50, env.step_uniforms, generator=generator)
        state, _ = env.step(state, actions, uniforms)
    away = torch.minimum(state.positions[:, 8:], 1 - state.positions[:, 8:]).amin(-1)
    assert least < (away <= 0.01).sum(-1).float().mean().item() < most


def test_nothing_is_ever_lost() -> None:
    """After 2,000 random steps everything is in the square, and no object is near standing out."""
    env = build(dataclasses.replace(PAPER["waterworld-n8"], food_speed=0.1, poison_speed=0.1))
    generator = torch.Generator().manual_seed(0)
    state = env.reset(torch.rand(4, env.reset_uniforms, generator=generator))
    for _ in range(2000):
        actions = torch.rand(4, 8, 2, generator=generator) * 2 - 1
        uniforms = torch.rand(4, env.step_uniforms, generator=generator)
        state, transition = env.step(state, actions, uniforms)
        assert ((state.positions >= 0) & (state.positions <= 1)).all()
        assert transition.discount.tolist() == [1.0] * 4
    assert state.velocities[:, 8:].abs().max() <= 0.05


def test_start_is_outside_the_obstacle_and_at_rest() -> None:
    """Everything begins two of its radii from the obstacle; objects' speeds are within half."""
    env = build(PAPER["waterworld-n10"])
    state = env.reset(
        torch.rand(500, env.reset_uniforms, generator=torch.Generator().manual_seed(4))
    )
    distance = (state.positions - 0.5).norm(dim=-1)
    for things, berth in ((slice(10), 0.24), (slice(10, 20), 0.28), (slice(20, 30), 0.23)):
        assert distance[:, things].min() > berth - 1e-6
    assert (state.velocities[:, :10] == 0).all()
    assert 0.0049 < state.velocities[:, 10:].abs().max() <= 0.005


WRONG: dict[str, dict[str, Any]] = {
    "pursuers must be at least 1": {"pursuers": 0},
    "food must be at least 1": {"food": 0},
    "catchers must be at most": {"catchers": 9},
    "radius must be above 0": {"radius": 0.0},
    "sensor_range must be above 0": {"sensor_range": float("nan")},
    "obstacle_radius must not be negative": {"obstacle_radius": -0.1},
    "must stay below": {"obstacle_radius": 0.45},
}


@pytest.mark.parametrize("message", WRONG)
def test_impossible_settings_are_refused(message: str) -> None:
    """A game that cannot be played is a ValueError that names the setting."""
    with pytest.raises(ValueError, match=message):
        Config(**WRONG[message])


def test_a_game_without_poison_is_played() -> None:
    """No poison is a setting like any other."""
    config = params(poison=0, **CALM)
    state = state_of(*at_rest((0.5, 0.5), (0.51, 0.5)))
    _, transition = build(config).step(state, torch.zeros(1, 2), torch.full((4,), 0.3))
    assert transition.info["poison_met"].item() == 0
