"""What a sensor of waterworld reads at its edges, from positions that a pencil can check.

The pursuer rests at (1/2, 1/2); sensors point east, north, west and south and are 1/8 long, its
radius is 1/32: numbers that floats hold exactly.
"""

import math

import pytest
import torch
from torch import Tensor

from msgdrop_envs.waterworld.config import PAPER, Config
from tests.slow_waterworld import Vector
from tests.waterworld_positions import FAR, at_rest, build, params, sensor_block, state_of

EAST, NORTH, WEST, SOUTH = range(4)
TINY = 2.0**-20
SHORT = params(sensors=4, sensor_range=0.125, radius=0.03125)


def readings(away: Vector, config: Config = SHORT, velocity: Vector = (0.0, 0.0)) -> Tensor:
    """What the sensors read of a food this far away, [2 (distance, velocity), S]."""
    food = ((0.5 + away[0], 0.5 + away[1]), velocity)
    obs = build(config).observe(state_of(*at_rest((0.5, 0.5)), food, *at_rest(FAR)))
    return sensor_block(obs, config)[0, 1]


# name: (where the food is, which sensors read which distance)
EDGES: dict[str, tuple[Vector, dict[int, float]]] = {
    "before the end": ((0.1, 0.0), {EAST: 0.1}),
    "at the end": ((0.125, 0.0), {EAST: 0.125}),
    "behind the end, though it reaches over it": ((0.125 + TINY, 0.0), {}),
    "to the side": ((0.1, 0.03), {EAST: 0.1}),
    "at the edge of its width": ((0.1, 0.03125), {EAST: 0.1}),
    "beyond its width, though it is wide": ((0.1, 0.03125 + TINY), {}),
    "at the end and the edge": ((0.125, -0.03125), {EAST: 0.125}),
    "exactly behind": ((-0.1, 0.0), {WEST: 0.1}),
    "to the south": ((0.0, -0.1), {SOUTH: 0.1}),
    "overlapping, to the north-east": ((0.01, 0.02), {EAST: 0.01, NORTH: 0.02}),
    "overlapping, to the north: abreast of two": ((0.0, 0.02), {NORTH: 0.02}),
    "on the pursuer": ((0.0, 0.0), {}),
    "far away": ((0.3, 0.3), {}),
}


@pytest.mark.parametrize("name", EDGES)
def test_edges_of_a_sensor(name: str) -> None:
    """Up to its length and to its width, both included, and never backwards."""
    away, expected = EDGES[name]
    distances = readings(away)[0].tolist()
    assert distances == pytest.approx([expected.get(sensor, 0.0) for sensor in range(4)], abs=1e-7)


def test_velocity_is_along_the_sensor() -> None:
    """Away is positive; what goes across is not seen; what is abreast or on top is met at 0."""
    assert readings((0.1, 0.0), velocity=(0.01, 0.5))[1].tolist() == pytest.approx([0.01, 0, 0, 0])
    assert readings((-0.1, 0), velocity=(0.01, 0.5))[1].tolist() == pytest.approx([0, 0, -0.01, 0])
    on_top = readings((0.0, 0.0), velocity=(0.01, 0.02))
    assert on_top.tolist() == [[0.0] * 4, pytest.approx([0.01, 0.02, -0.01, -0.02])]


def test_velocity_is_relative() -> None:
    """A pursuer that follows a food at its speed sees it at rest."""
    velocity = (0.03, -0.01)
    discs = [((0.5, 0.5), velocity), ((0.6, 0.5), velocity), (FAR, (0.0, 0.0))]
    assert sensor_block(build(SHORT).observe(state_of(*discs)), SHORT)[0, 1, 1].tolist() == [0] * 4


@pytest.mark.parametrize("order", [1, -1])
def test_nearest_of_two_on_one_ray_is_read(order: int) -> None:
    """Its distance and its velocity, wherever it stands in the list."""
    two = [((0.6, 0.5), (0.01, 0.0)), ((0.56, 0.5), (-0.02, 0.0))][::order]
    config = params(sensors=4, sensor_range=0.125, radius=0.03125, food=2)
    obs = build(config).observe(state_of(*at_rest((0.5, 0.5)), *two, *at_rest(FAR)))
    distances, velocities = sensor_block(obs, config)[0, 1].tolist()
    assert distances == pytest.approx([0.06, 0, 0, 0])
    assert velocities == pytest.approx([-0.02, 0, 0, 0])


def test_first_of_equally_near_is_read() -> None:
    """Two foods at one distance along the ray: the first in the list gives the velocity."""
    config = params(sensors=4, sensor_range=0.125, radius=0.03125, food=2)
    two = [((0.5625, 0.515625), (0.01, 0.0)), ((0.5625, 0.5), (0.03, 0.0))]
    for given, velocity in ((two, 0.01), (two[::-1], 0.03)):
        obs = build(config).observe(state_of(*at_rest((0.5, 0.5)), *given, *at_rest(FAR)))
        assert sensor_block(obs, config)[0, 1].tolist() == [
            [0.0625, 0, 0, 0],
            pytest.approx([velocity, 0, 0, 0]),
        ]


def test_classes_do_not_hide_each_other() -> None:
    """An ally, a food and a poison on one ray are all read, and nobody reads itself."""
    config = params(sensors=4, sensor_range=0.125, radius=0.03125, pursuers=2)
    east, nearer, near = (0.6, 0.5), (0.58, 0.5), (0.54, 0.5)
    obs = build(config).observe(state_of(*at_rest((0.5, 0.5), near, nearer, east)))
    block = sensor_block(obs, config)
    assert block[0, :, 0, EAST].tolist() == pytest.approx([0.04, 0.08, 0.1])
    assert block[0, :, 0, WEST].tolist() == [0, 0, 0]
    assert block[1, :, 0, WEST].tolist() == pytest.approx([0.04, 0, 0])
    assert block[1, :, 0, EAST].tolist() == pytest.approx([0, 0.04, 0.06])


def test_width_may_be_the_objects() -> None:
    """As in PettingZoo: food of radius 1/16 is met up to 1/16 to the side."""
    wide = params(sensors=4, sensor_range=0.125, radius=0.03125, sensor_width="object")
    assert readings((0.1, 0.0625), wide)[0].tolist() == pytest.approx([0.1, 0, 0, 0])
    assert readings((0.1, 0.0625 + TINY), wide)[0].tolist() == [0, 0, 0, 0]


def test_observation_has_the_papers_152_numbers() -> None:
    """Position x 2 - 1; distance / range and velocity / 0.02 of allies, food, poison in turn."""
    config = PAPER["waterworld-n8"]
    env = build(config)
    discs = at_rest((0.5, 0.25), *[FAR] * 27)
    discs[1] = ((0.53, 0.25), (0.01, 0.0))
    discs[8] = ((0.56, 0.25), (0.02, 0.0))
    discs[18] = ((0.59, 0.25), (0.03, 0.0))
    obs = env.observe(state_of(*discs))
    assert env.observation_size == 152
    assert obs[0, :2].tolist() == [0.0, -0.5]
    first = {2: 0.2, 27: 0.5, 52: 0.4, 77: 1.0, 102: 0.6, 127: 1.5}
    assert {place: obs[0, place].item() for place in first} == pytest.approx(first, abs=1e-6)
    raw = build(params(pursuers=8, food=10, poison=10)).observe(state_of(*discs))
    expected = [0.5, 0.25, 0.03, 0.01, 0.06, 0.02, 0.09, 0.03]
    assert raw[0, [0, 1, *first]].tolist() == pytest.approx(expected)


def test_everything_in_range_is_met_by_some_sensor() -> None:
    """25 sensors of the paper's length leave no gap as wide as a pursuer (figure 2c)."""
    config = params(sensors=25)
    for number in range(360):
        angle = math.radians(number)
        away = (0.1488 * math.cos(angle), 0.1488 * math.sin(angle))
        assert readings(away, config)[0].max() > 0.14


def test_obstacle_and_touch_can_be_shown() -> None:
    """25 distances to the obstacle's rim and two flags, as MADRL has, at the end."""
    config = params(
        obstacle_radius=0.2, sensors=4, senses_obstacle=True, senses_touch=True, catchers=1
    )
    env = build(config)
    assert env.observation_size == 2 + 6 * 4 + 4 + 2
    for place, rim in (
        ((0.2, 0.5), 0.1),
        ((0.1, 0.5), 0.0),
        ((0.2, 0.6), 0.126795),
        ((0.5, 0.5), 0),
    ):
        obs = env.observe(state_of(*at_rest(place, (0.9, 0.9), FAR)))
        assert obs[0, -6:].tolist() == pytest.approx([rim, 0, 0, 0, 0, 0], abs=1e-6)
    beside = (0.255, 0.5)
    for food, poison, flags in (
        (beside, FAR, [1, 0]),
        (FAR, beside, [0, 0]),
        (FAR, (0.23, 0.5), [0, 1]),
    ):
        obs = env.observe(state_of(*at_rest((0.2, 0.5), food, poison)))
        assert obs[0, -2:].tolist() == flags


def test_a_game_without_anything_near_reads_zeros() -> None:
    """No near pair at all is no special case."""
    obs = build(SHORT).observe(state_of(*at_rest((0.5, 0.5), (0.9, 0.9), FAR)))
    assert torch.equal(obs, torch.tensor([[0.5, 0.5, *[0.0] * 24]]))
