"""What an update must cost, against the pencil."""

import pytest
import torch

from benchmarks import counting, engine, growth
from benchmarks.counting import DENSE, Cost, Shares, Sizes
from benchmarks.roofline import Measured
from benchmarks.updates import CASES, parameters, shares, update_cost
from msgdrop_cli.engine.training import Training
from msgdrop_cli.networks.stacked import parameter_count

PURSUIT = {"f1": (147, 64), "f2": (64, 48), "g1": (735, 96), "h1": (144, 32), "h2": (32, 5)}
ACTOR = {"layer1": (152, 64), "layer2": (64, 2)}
CRITIC = {
    **{"f1": (154, 200), "f2": (202, 100), "g1": (1078, 100)},
    **{"h1": (200, 64), "h2": (64, 1)},
}


def test_parameters_are_the_papers() -> None:
    """An agent of pursuit N=6 has 88,053 parameters, waterworld's critic 172,129."""
    assert parameter_count(PURSUIT) == 88_053
    assert parameter_count(CRITIC) == 172_129


def test_a_pass_multiplies_every_weight_once() -> None:
    """87,808 weights; the gradient of the hidden units does without the first layers' 79,968."""
    assert counting.forward(PURSUIT) == 87_808
    assert counting.backward(PURSUIT) == 87_808 - 147 * 64 - 735 * 96


def test_zeros_are_left_out_of_the_first_layers_only() -> None:
    """One input in four not zero, half of the messages kept: a fourth of f1, an eighth of g1."""
    left = counting.forward(PURSUIT, nonzero=0.25, kept=0.5)
    assert left == 7_840 + 147 * 64 / 4 + 735 * 96 / 8


def test_update_of_pursuit_by_pencil() -> None:
    """Three passes and the weights' gradient, 87,808 each; 7,840 for the units; 6 x 32 rows."""
    cost = counting.q_update(PURSUIT, Sizes(6, 32, 147, 1), senders=5, shares=DENSE)
    assert cost.multiply_adds == 6 * 32 * (4 * 87_808 + 7_840)
    # 9 numbers of 4 bytes a parameter; 32 observations and 32 next ones of 6 agents, in bytes.
    assert cost.bytes == 6 * (36 * 88_053 + 64 * 6 * 147)


def test_the_mask_leaves_the_pass_that_picks_the_action_alone() -> None:
    """With all messages dropped g is still multiplied once, for Q_exec."""
    sizes = Sizes(1, 1, 147, 1)
    kept = counting.q_update(PURSUIT, sizes, 5, DENSE).multiply_adds
    dropped = counting.q_update(PURSUIT, sizes, 5, Shares(1.0, 0.0)).multiply_adds
    assert kept - dropped == 3 * 735 * 96


def test_update_of_maddpg_by_pencil() -> None:
    """One row: target actor, three times the critic and its units; half of an actor's update."""
    sizes = Sizes(8, 32, 152, 4, action=2)
    cost = counting.maddpg_update(ACTOR, CRITIC, sizes, DENSE, actor_updates_each=0.5)
    actor, critic = 152 * 64 + 64 * 2, 154 * 200 + 202 * 100 + 1078 * 100 + 200 * 64 + 64
    of_critic = actor + 3 * critic + 200 * 100 + 200 * 64 + 64
    to_action = 64 + 64 * 100 + 100 * 202 + 200 * 2
    of_actor = actor + critic + to_action + actor + 64 * 2
    assert cost.multiply_adds == 256 * (of_critic + of_actor / 2)
    # 10 numbers a parameter of the critic; the actor's target is read, half of the rest is moved.
    numbers = 10 * 172_129 + (1 + 9 / 2) * 9_922
    assert cost.bytes == 4 * (numbers + 2 * 256 * 152 + 256 * 2)


def test_the_floor_is_the_longer_time_at_the_fastest_copy() -> None:
    """A billion multiply-adds at 10 G/s take 100 ms; 8 GB at 100 GB/s, the faster copy, 80 ms."""
    measured = Measured(10e9, {"large": 40e9, "small": 100e9}, {})
    assert measured.both_ms(Cost(1e9, 8e9)) == pytest.approx((100, 80))
    assert measured.floor_ms(Cost(1e9, 8e9)) == pytest.approx(100)
    assert measured.floor_ms(Cost(1e9, 16e9)) == pytest.approx(160)


@pytest.mark.parametrize(
    ("environment", "count", "millions"),
    [
        ("pursuit-n6", 6 * 88_053, 68.9),
        ("pursuit-n8", 8 * 150_261, 155.9),
        ("navigation-n8", 8 * 25_989, 28.5),
        ("waterworld-n8", 172_129 + 9_922, 170.8),
    ],
)
def test_trainings_are_counted(environment: str, count: int, millions: float) -> None:
    """The paper's cases have the paper's parameters, and the multiply-adds of the pencil."""
    training = Training([growth.smaller(engine.spec(environment, CASES[environment]))])
    assert parameters(training) == count
    assert round(update_cost(training, DENSE).multiply_adds / 1e6, 1) == millions


def test_shares_are_those_of_the_replay() -> None:
    """Of two stored steps of eight games one number in four is not 0; MD 0.2 keeps four fifths."""
    training = Training([growth.smaller(engine.spec("pursuit-n6", "dcc-md"))])
    training.begin()
    for _ in range(2):
        training.play(torch.zeros(1, 8, 6, dtype=torch.int64))
    training.replay.obs.zero_()
    training.replay.obs[0, :4] = 1  # four of the sixteen rows
    assert shares(training) == pytest.approx((0.25, 0.8))


@pytest.mark.parametrize("environment", growth.VARIED)
def test_games_of_other_sizes_can_be_built(environment: str) -> None:
    """With twice the agents an update has more than twice the multiply-adds."""
    few, many = (
        update_cost(Training([growth.sized(environment, agents)]), DENSE).multiply_adds
        for agents in (4, 8)
    )
    assert many > 2 * few
