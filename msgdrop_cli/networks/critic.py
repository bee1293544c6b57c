"""Critics of continuous actions: Q(o, a, the others' observations and actions), figure 9.

Letters: `G` networks, `B` rows, `O` observation, `A` numbers of an action, `S` senders.
"""

from typing import Literal, Protocol

import torch
from torch import Tensor

from msgdrop_cli.networks.perceptron import Perceptron
from msgdrop_cli.networks.stacked import Layers, Stacked, dense


class Critic(Protocol):
    """A critic's architecture; the weights are held apart, as a Stacked of its layers."""

    layers: Layers
    senders: int
    """S, the agents whose observations and actions are among its inputs."""

    def forward(self, weights: Stacked, own: Tensor, action: Tensor, others: Tensor) -> Tensor:
        """Q [G, B, 1] of own [G, B, O], action [G, B, A], others [G, B, S*(O+A)]."""


class FGHCritic:
    """f: (o, a)-200, (200, a)-100; g: others-100; h: 200-64-1 (l. 770). Without senders no g."""

    def __init__(
        self,
        observation: int,
        action: int,
        senders: int,
        *,
        f_units: tuple[int, int],
        g_units: int,
        h_units: int,
    ) -> None:
        self.senders = senders
        joint = f_units[1] + (g_units if senders else 0)
        f: Layers = {
            "f1": (observation + action, f_units[0]),
            "f2": (f_units[0] + action, f_units[1]),
        }
        g: Layers = {"g1": (senders * (observation + action), g_units)} if senders else {}
        self.layers: Layers = {**f, **g, "h1": (joint, h_units), "h2": (h_units, 1)}

    def forward(self, weights: Stacked, own: Tensor, action: Tensor, others: Tensor) -> Tensor:
        """The action enters f twice (l. 770); shapes as in `Critic`."""
        f = dense(weights["f1"], torch.cat((own, action), -1)).relu()
        joint = dense(weights["f2"], torch.cat((f, action), -1)).relu()
        if self.senders:
            joint = torch.cat((joint, dense(weights["g1"], others).relu()), -1)
        return dense(weights["h2"], dense(weights["h1"], joint).relu())


class ConcatCritic:
    """One perceptron on everything: vanilla MADDPG's critic, (o, a, others)-200-100-64-1."""

    def __init__(self, observation: int, action: int, senders: int, units: tuple[int, ...]) -> None:
        self.senders = senders
        self._perceptron = Perceptron((1 + senders) * (observation + action), senders, units, 1)
        self.layers: Layers = self._perceptron.layers

    def forward(self, weights: Stacked, own: Tensor, action: Tensor, others: Tensor) -> Tensor:
        """Shapes as in `Critic`."""
        return self._perceptron.forward(weights, torch.cat((own, action, others), -1))


def critic_of(
    kind: Literal["fgh", "concat", "own"],
    observation: int,
    action: int,
    agents: int,
    f_units: tuple[int, int],
    g_units: int,
    h_units: int,
) -> Critic:
    """h(f, g), one perceptron on everything, or h(f), which hears nobody."""
    senders = 0 if kind == "own" else agents - 1
    if kind == "concat":
        return ConcatCritic(observation, action, senders, (*f_units, h_units))
    return FGHCritic(
        observation, action, senders, f_units=f_units, g_units=g_units, h_units=h_units
    )
