"""Critics of continuous actions: Q(o, a, the others' observations and actions), figure 9.

Both carry a gradient into their weights and, for the policy gradient, into the own action alone.
Letters: `G` networks, `B` rows, `O` observation, `A` numbers of an action, `S` senders.
"""

from typing import Any, Literal, NamedTuple, Protocol

import torch
from torch import Tensor

from msgdrop_cli.networks.perceptron import Perceptron
from msgdrop_cli.networks.shared_others import SharedOthers, WithOthers
from msgdrop_cli.networks.stacked import Apart, Layers, Stacked, dense, dense_backward, through_relu


class Critic(Protocol):
    """A critic's architecture; the weights are held apart, as a Stacked of its layers."""

    layers: Layers
    hears: int
    """S, the agents whose observations and actions are among its inputs."""

    def forward(
        self, weights: Stacked, own: Tensor, action: Tensor, others: Tensor | SharedOthers
    ) -> tuple[Tensor, Any]:
        """Q [G, B, 1] of own [G, B, O], action [G, B, A], others [G, B, S*(O+A)], and a trace."""

    def backward(self, weights: Stacked, trace: Any, grad_q: Tensor, gradients: Stacked) -> None:
        """Write the gradients; grad_q [G, B, 1]."""

    def action_gradient(self, weights: Stacked, trace: Any, grad_q: Tensor) -> Tensor:
        """The gradient with respect to the own action, [G, B, A]; grad_q [G, B, 1]."""


class Trace(NamedTuple):
    """What the backward pass needs of a forward pass, each [G, B, units]."""

    own: Tensor | Apart
    """(o, a)"""
    others: Tensor | SharedOthers
    f1: Tensor
    """(f1, a)"""
    joint: Tensor
    h1: Tensor


class FGHCritic:
    """f: (o, a)-200, (200, a)-100; g: others-100; h: 200-64-1 (l. 770). Without senders no g."""

    def __init__(
        self,
        observation: int,
        action: int,
        senders: int,
        *,
        own_units: tuple[int, int],
        others_units: int,
        joint_units: int,
    ) -> None:
        self.hears = senders
        self._action, self._own_units = action, own_units
        joint = own_units[1] + (others_units if senders else 0)
        f: Layers = {
            "f1": (observation + action, own_units[0]),
            "f2": (own_units[0] + action, own_units[1]),
        }
        g: Layers = {"g1": (senders * (observation + action), others_units)} if senders else {}
        self.layers: Layers = {**f, **g, "h1": (joint, joint_units), "h2": (joint_units, 1)}

    def forward(
        self, weights: Stacked, own: Tensor, action: Tensor, others: Tensor | SharedOthers
    ) -> tuple[Tensor, Trace]:
        """The action enters f twice (l. 770); shapes as in `Critic`."""
        seen = torch.cat((own, action), -1)
        f1 = torch.cat((dense(weights["f1"], seen).relu_(), action), -1)
        joint = dense(weights["f2"], f1)
        if self.hears:
            joint = torch.cat((joint, dense(weights["g1"], others)), -1)
        joint = joint.relu_()  # [G, B, f + g]
        h1 = dense(weights["h1"], joint).relu_()
        return dense(weights["h2"], h1), Trace(seen, others, f1, joint, h1)

    def backward(self, weights: Stacked, trace: Trace, grad_q: Tensor, gradients: Stacked) -> None:
        """Write the gradients of all weights; grad_q [G, B, 1]."""
        dense_backward(gradients["h2"], trace.h1, grad_q)
        grad_h1 = through_relu(weights["h2"], grad_q, trace.h1)
        dense_backward(gradients["h1"], trace.joint, grad_h1)
        grad_joint = through_relu(weights["h1"], grad_h1, trace.joint)
        first, second = self._own_units
        grad_f2 = grad_joint[..., :second]
        if self.hears:
            dense_backward(gradients["g1"], trace.others, grad_joint[..., second:])
        dense_backward(gradients["f2"], trace.f1, grad_f2)
        grad_f1, _ = through_relu(weights["f2"], grad_f2, trace.f1).split([first, self._action], -1)
        dense_backward(gradients["f1"], trace.own, grad_f1)

    def action_gradient(self, weights: Stacked, trace: Trace, grad_q: Tensor) -> Tensor:
        """Through both places where the action enters; the weights' gradients are left alone."""
        first, second = self._own_units
        grad_h1 = through_relu(weights["h2"], grad_q, trace.h1)
        grad_f2 = through_relu(weights["h1"], grad_h1, trace.joint)[..., :second]
        entered = torch.bmm(grad_f2, weights["f2"].weight.mT)  # [G, B, first + A]
        grad_f1 = entered[..., :first] * (trace.f1[..., :first] > 0)
        early = torch.bmm(grad_f1, weights["f1"].weight[:, -self._action :].mT)
        return early + entered[..., first:]


class ConcatCritic:
    """One perceptron on everything: vanilla MADDPG's critic, (o, a, others)-200-100-64-1."""

    def __init__(self, observation: int, action: int, senders: int, units: tuple[int, ...]) -> None:
        self.hears = senders
        self._own = slice(observation, observation + action)
        self._perceptron = Perceptron((1 + senders) * (observation + action), senders, units, 1)
        self.layers: Layers = self._perceptron.layers

    def forward(
        self, weights: Stacked, own: Tensor, action: Tensor, others: Tensor | SharedOthers
    ) -> tuple[Tensor, list[Tensor | Apart]]:
        """Shapes as in `Critic`."""
        mine = torch.cat((own, action), -1)
        everything: Tensor | Apart
        if isinstance(others, SharedOthers):
            everything = WithOthers(mine, mine.shape[-1], others)
        else:
            everything = torch.cat((mine, others), -1)
        return self._perceptron.forward(weights, everything)

    def backward(
        self,
        weights: Stacked,
        trace: list[Tensor | Apart],
        grad_q: Tensor,
        gradients: Stacked,
    ) -> None:
        """Write the gradients of all weights; grad_q [G, B, 1]."""
        self._perceptron.backward(weights, trace, grad_q, gradients)

    def action_gradient(
        self, weights: Stacked, trace: list[Tensor | Apart], grad_q: Tensor
    ) -> Tensor:
        """Down to the columns of the own action; the weights' gradients are left alone."""
        first, *later = self.layers
        gradient = grad_q
        for name, inputs in zip(reversed(later), reversed(trace[1:]), strict=True):
            assert isinstance(inputs, Tensor)
            gradient = through_relu(weights[name], gradient, inputs)
        return torch.bmm(gradient, weights[first].weight[:, self._own].mT)


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
    units: Any = {"own_units": f_units, "others_units": g_units, "joint_units": h_units}
    return FGHCritic(observation, action, senders, **units)
