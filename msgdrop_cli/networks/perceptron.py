"""One plain perceptron: FDC on the own observation, Concat on own observation and messages."""

from torch import Tensor

from msgdrop_cli.networks.stacked import Layers, Stacked, dense


class Perceptron:
    """inputs-64-48-32-5 in pursuit (FDC l. 750; Concat-MD takes FDC's widths, PAPER.md)."""

    def __init__(self, inputs: int, senders: int, units: tuple[int, ...], outputs: int) -> None:
        self.senders = senders
        widths = (inputs, *units, outputs)
        self.layers: Layers = {
            f"layer{n}": (widths[n - 1], widths[n]) for n in range(1, len(widths))
        }

    def forward(self, weights: Stacked, inputs: Tensor) -> Tensor:
        """Q, or an actor's numbers, [G, B, outputs] of inputs [G, B, inputs]."""
        *hidden, last = self.layers
        for name in hidden:
            inputs = dense(weights[name], inputs).relu()
        return dense(weights[last], inputs)
