"""One plain perceptron: FDC on the own observation, Concat on own observation and messages."""

from torch import Tensor

from msgdrop_cli.networks.stacked import Layers, Stacked, dense, dense_backward, through_relu


class Perceptron:
    """inputs-64-48-32-5 in pursuit (FDC l. 750; Concat-MD takes FDC's widths, paper-facts 6.1)."""

    def __init__(self, inputs: int, hears: int, units: tuple[int, ...], actions: int) -> None:
        self.hears = hears
        widths = (inputs, *units, actions)
        self.layers: Layers = {
            f"layer{n}": (widths[n - 1], widths[n]) for n in range(1, len(widths))
        }

    def forward(self, weights: Stacked, inputs: Tensor) -> tuple[Tensor, list[Tensor]]:
        """inputs: [G, B, inputs]; returns Q [G, B, A] and the inputs of every layer."""
        trace: list[Tensor] = [inputs]
        *hidden, last = self.layers
        for name in hidden:
            trace.append(dense(weights[name], trace[-1]).relu_())
        return dense(weights[last], trace[-1]), trace

    def backward(
        self,
        weights: Stacked,
        trace: list[Tensor],
        grad_q: Tensor,
        gradients: Stacked,
    ) -> None:
        """Write the gradients for the first grad_q.shape[1] rows of the trace; grad_q [G, B, A]."""
        gradient = grad_q
        for name, inputs in zip(reversed(list(self.layers)), reversed(trace), strict=True):
            dense_backward(gradients[name], inputs, gradient)
            if inputs is not trace[0]:
                gradient = through_relu(weights[name], gradient, inputs)
