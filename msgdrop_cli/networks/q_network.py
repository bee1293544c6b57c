"""The networks of the Q-learners: h(f, g), or one perceptron on everything or on the own only."""

from typing import Literal

from msgdrop_cli.networks.fgh import FGH
from msgdrop_cli.networks.perceptron import Perceptron
from msgdrop_cli.networks.stacked import Network


def q_network(
    kind: Literal["fgh", "concat", "own"],
    observation: int,
    message: int,
    senders: int,
    actions: int,
    f_units: tuple[int, int],
    g_units: int,
    h_units: int,
) -> Network:
    """h(f, g) (l. 404), or a perceptron on everything ("concat", l. 515) or on the own ("own").

    message: the numbers of one message (an observation, as a rule).
    """
    units = (*f_units, h_units)
    if kind == "own":
        return Perceptron(observation, 0, units, actions)
    if kind == "concat":
        return Perceptron(observation + senders * message, senders, units, actions)
    return FGH(
        *(observation, message, senders, actions),
        f_units=f_units,
        g_units=g_units,
        h_units=h_units,
    )
