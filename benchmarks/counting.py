"""What one update must cost, counted by pencil: multiply-adds, and bytes to and from memory.

Every product is counted once; every weight, gradient and Adam moment is read once and written
once; target weights are read, and written where they follow; the minibatch is read out of the
replay. Left out is what is small beside these: biases, activations (they stay in the first-level
cache), the arithmetic of Adam, the rare copy to a target network of Q-learning.

A zero in the first layers' input need not be multiplied. `Shares` says how much is left if none
is; `DENSE` counts everything.
"""

from collections.abc import Iterable
from typing import NamedTuple

from msgdrop_cli.networks.stacked import Layers, parameter_count

BYTES = 4
"""Of a float32."""
MOVED = 4 * 2
"""Numbers moved for each parameter: weight, gradient and both moments, read and written."""
OWN_FIRST, OTHERS_FIRST = {"f1", "layer1"}, {"g1"}
"""Layers on the own observation and on what is told of the others: no gradient goes below them."""


class Cost(NamedTuple):
    """Of one update of all networks of a run."""

    multiply_adds: float
    bytes: float


class Shares(NamedTuple):
    """How much of the first layers' products are not by zero."""

    nonzero: float
    """Of the observations' numbers; actions beside them are counted alike."""
    kept: float
    """Of the messages, where the mask of message-dropout applies."""


DENSE = Shares(1.0, 1.0)


class Sizes(NamedTuple):
    """What an update is made of."""

    agents: int
    batch: int
    """Transitions an agent and update."""
    observation: int
    observation_bytes: int
    """Of one of its numbers, as the replay holds them."""
    action: int = 0
    """Numbers of an action, where it is numbers."""


def forward(layers: Layers, nonzero: float = 1.0, kept: float = 1.0) -> float:
    """Multiply-adds that one row takes through one network."""
    first = nonzero * _products(layers, OWN_FIRST)
    heard = nonzero * kept * _products(layers, OTHERS_FIRST)
    return first + heard + backward(layers)


def backward(layers: Layers) -> int:
    """Multiply-adds that carry one row's gradient back to the outputs of the first layers."""
    return _products(layers, layers.keys() - OWN_FIRST - OTHERS_FIRST)


def q_update(layers: Layers, sizes: Sizes, senders: int, shares: Shares) -> Cost:
    """One update of N Q-networks, each on a minibatch of its own (paper l. 244).

    The online network sees (o, m~) and, unmasked, (o', m'); the target network sees (o', m~');
    then come the gradient of the weights, whose products are those of a pass on (o, m~), and that
    of the hidden units.
    """
    masked = forward(layers, *shares)
    unmasked = forward(layers, shares.nonzero)
    row = 3 * masked + unmasked + backward(layers)
    minibatch = 2 * sizes.batch * (1 + senders) * sizes.observation * sizes.observation_bytes
    moved = (MOVED + 1) * BYTES * parameter_count(layers) + minibatch
    return Cost(sizes.agents * sizes.batch * row, sizes.agents * moved)


def maddpg_update(
    actor: Layers, critic: Layers, sizes: Sizes, shares: Shares, actor_updates_each: float
) -> Cost:
    """One update of the critic h(f, g) that all agents share, and a share of one of the actor.

    `actor_updates_each`: updates of the actor for each of the critic. All agents' rows of the
    joint minibatch go through the same networks. The policy gradient is carried from Q through
    h and f down to the own action only.
    """
    first, second = critic["f1"][1], critic["f2"][1]
    act = forward(actor, shares.nonzero)
    judge = forward(critic, *shares)
    hidden = backward(critic) - sizes.action * second  # the action that enters f2 needs no gradient
    critic_row = act + 3 * judge + hidden  # target actor, target critic, critic, weights, units
    h1, h2 = critic["h1"][1], critic["h2"][1]
    to_action = h2 * h1 + h1 * second + second * (first + sizes.action) + first * sizes.action
    actor_row = 2 * act + backward(actor) + judge + to_action
    rows = sizes.agents * sizes.batch
    followed = MOVED + 2  # the target network is read and written, too
    moved = float(parameter_count(critic) * followed)
    moved += parameter_count(actor) * (1 + actor_updates_each * (followed - 1))
    minibatch = 2 * rows * sizes.observation * sizes.observation_bytes
    minibatch += rows * sizes.action * BYTES
    return Cost(rows * (critic_row + actor_updates_each * actor_row), BYTES * moved + minibatch)


def _products(layers: Layers, names: Iterable[str]) -> int:
    return sum(layers[name][0] * layers[name][1] for name in names if name in layers)
