"""Q = h(f(o), g(m)): the paper's architecture (l. 401-407; sizes l. 745-751, figure 8)."""

import torch
from torch import Tensor

from msgdrop_cli.networks.stacked import Layers, Stacked, dense


class FGH:
    """f: own-64-48, g: messages-96, h: 144-32-5 in pursuit N=6; ReLU on all but the last layer."""

    def __init__(
        self,
        observation: int,
        message: int,
        senders: int,
        actions: int,
        *,
        f_units: tuple[int, int],
        g_units: int,
        h_units: int,
    ) -> None:
        self._observation = observation
        self.senders = senders
        self.layers: Layers = {
            "f1": (observation, f_units[0]),
            "f2": f_units,
            "g1": (senders * message, g_units),
            "h1": (f_units[1] + g_units, h_units),
            "h2": (h_units, actions),
        }

    def forward(self, weights: Stacked, inputs: Tensor) -> Tensor:
        """Q [G, B, A] of inputs [G, B, O + S*M]."""
        own, messages = inputs[..., : self._observation], inputs[..., self._observation :]
        f = dense(weights["f2"], dense(weights["f1"], own).relu()).relu()
        g = dense(weights["g1"], messages).relu()
        h = dense(weights["h1"], torch.cat((f, g), -1)).relu()
        return dense(weights["h2"], h)
