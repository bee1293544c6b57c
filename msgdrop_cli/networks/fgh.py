"""Q = h(f(o), g(m)): the paper's architecture (l. 401-407; sizes l. 745-751, figure 8)."""

from typing import NamedTuple

import torch
from torch import Tensor

from msgdrop_cli.networks.stacked import Apart, Layers, Stacked, dense, dense_backward, through_relu


class Trace(NamedTuple):
    """What the backward pass needs of a forward pass, each [G, B, units]."""

    own: Tensor
    messages: Tensor
    f1: Tensor
    joint: Tensor
    h1: Tensor


class FGH:
    """f: own-64-48, g: messages-96, h: 144-32-5 in pursuit N=6; ReLU on all but the last layer."""

    def __init__(
        self,
        observation: int,
        message: int,
        senders: int,
        actions: int,
        *,
        own_units: tuple[int, int],
        message_units: int,
        joint_units: int,
    ) -> None:
        self._observation = observation
        self._own_features = own_units[1]
        self.hears = senders
        self.layers: Layers = {
            "f1": (observation, own_units[0]),
            "f2": own_units,
            "g1": (senders * message, message_units),
            "h1": (own_units[1] + message_units, joint_units),
            "h2": (joint_units, actions),
        }

    def forward(self, weights: Stacked, inputs: Tensor | Apart) -> tuple[Tensor, Trace]:
        """inputs: [G, B, O + S*M], a tensor; returns Q [G, B, A] and the trace."""
        assert isinstance(inputs, Tensor)
        own, messages = inputs[..., : self._observation], inputs[..., self._observation :]
        f1 = dense(weights["f1"], own).relu_()
        f2 = dense(weights["f2"], f1)
        g1 = dense(weights["g1"], messages)
        joint = torch.cat((f2, g1), -1).relu_()  # [G, B, f + g]
        h1 = dense(weights["h1"], joint).relu_()
        return dense(weights["h2"], h1), Trace(own, messages, f1, joint, h1)

    def backward(self, weights: Stacked, trace: Trace, grad_q: Tensor, gradients: Stacked) -> None:
        """Write the gradients for the first grad_q.shape[1] rows of the trace; grad_q [G, B, A]."""
        own, messages, f1, joint, h1 = trace
        dense_backward(gradients["h2"], h1, grad_q)
        grad_h1 = through_relu(weights["h2"], grad_q, h1)
        dense_backward(gradients["h1"], joint, grad_h1)
        grad_joint = through_relu(weights["h1"], grad_h1, joint)
        grad_f2 = grad_joint[..., : self._own_features]
        dense_backward(gradients["g1"], messages, grad_joint[..., self._own_features :])
        dense_backward(gradients["f2"], f1, grad_f2)
        dense_backward(gradients["f1"], own, through_relu(weights["f2"], grad_f2, f1))
