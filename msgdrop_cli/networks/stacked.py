"""Weights of G = R*N equal networks in one flat tensor, and the dense layer over them.

One flat tensor means one Adam step and one target copy for everything. It is padded to whole
SIMD registers, so that no number is handled in a loop's tail: a run's bits must not depend on how
many runs it is stacked with (test_independence).
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor

Layers = Mapping[str, tuple[int, int]]
"""Layer name to (inputs, outputs)."""


class Apart(Protocol):
    """Inputs [G, B, in] of a first layer that are not multiplied out, or not with what is 0."""

    def times(self, weight: Tensor, bias: Tensor) -> Tensor:
        """The inputs times weight [G, in, out] plus bias [G, 1, out]: [G, B, out]."""

    def gradient(self, grad_output: Tensor, out: Tensor) -> None:
        """Write dL/dweight into `out` [G, in, out]; grad_output [G, rows, out], of the first."""


class Dense(NamedTuple):
    """One layer's weight [G, inputs, outputs] and bias [G, 1, outputs]: views of `flat`."""

    weight: Tensor
    bias: Tensor


class Stacked:
    """The weights (or gradients, or moments) of G networks: `flat`, and views by layer name."""

    def __init__(self, layers: Layers, networks: int, device: torch.device | str = "cpu") -> None:
        self.layers = layers
        self.networks = networks
        sizes = [networks * (i + 1) * o for i, o in layers.values()]
        self.flat = torch.zeros(math.ceil(sum(sizes) / 64) * 64, device=device)
        self.views: dict[str, Dense] = {}
        start = 0
        for (name, (i, o)), size in zip(layers.items(), sizes, strict=True):
            weight, bias = self.flat[start : start + size].split([networks * i * o, networks * o])
            self.views[name] = Dense(weight.view(networks, i, o), bias.view(networks, 1, o))
            start += size

    def __getitem__(self, layer: str) -> Dense:
        return self.views[layer]

    def of_networks(self, first: int, last: int) -> dict[str, Tensor]:
        """Views of the networks `first` to `last - 1`, by `layer.weight` and `layer.bias`."""
        return {
            f"{name}.{part}": getattr(dense, part)[first:last]
            for name, dense in self.views.items()
            for part in ("weight", "bias")
        }


class Network(Protocol):
    """An architecture; the weights are held apart, as a Stacked of its layers."""

    layers: Layers
    hears: int
    """S, the senders whose messages are among its inputs."""

    def forward(self, weights: Stacked, inputs: Tensor | Apart) -> tuple[Tensor, Any]:
        """Q [G, B, A] of the inputs [G, B, (1+S)*O], and a trace for `backward`."""

    def backward(self, weights: Stacked, trace: Any, grad_q: Tensor, gradients: Stacked) -> None:
        """Write the gradients of the trace's first rows; grad_q [G, rows, A]."""


def parameter_count(layers: Layers) -> int:
    """Weights and biases of one network."""
    return sum((inputs + 1) * outputs for inputs, outputs in layers.values())


def initialise(weights: Stacked, uniforms: Tensor) -> None:
    """Fill in place with U(-1/sqrt(inputs), 1/sqrt(inputs)), torch's default for a linear layer.

    uniforms: [R, N * parameter_count] in [0, 1), so that each run's weights are its own seed's.
    """
    runs = uniforms.shape[0]
    start = 0
    for name, (inputs, _) in weights.layers.items():
        for part in (weights[name].weight, weights[name].bias):
            count = part.numel() // runs
            numbers = uniforms[:, start : start + count].reshape(part.shape)
            part.copy_((2.0 * numbers - 1.0) / math.sqrt(inputs))
            start += count


def dense(layer: Dense, inputs: Tensor | Apart) -> Tensor:
    """Inputs [G, B, in] times weight plus bias: [G, B, out]."""
    if not isinstance(inputs, Tensor):
        return inputs.times(*layer)
    if layer.weight.shape[-1] == 1:  # one column: see `dense_backward`
        return (inputs * layer.weight.mT).sum(-1, keepdim=True) + layer.bias
    return torch.baddbmm(layer.bias, inputs, layer.weight)


def dense_backward(gradient: Dense, inputs: Tensor | Apart, grad_output: Tensor) -> None:
    """Write dL/dweight and dL/dbias into `gradient`.

    grad_output: [G, rows, out], for the first rows of the inputs [G, B, in]. A product with one
    column is no business of the matrix library: it takes a matrix-vector routine if G is 1, and
    on some processors that one adds up in another order (test_products).
    """
    torch.sum(grad_output, 1, keepdim=True, out=gradient.bias)
    if not isinstance(inputs, Tensor):
        inputs.gradient(grad_output, out=gradient.weight)
        return
    rows = inputs[:, : grad_output.shape[1]]
    if grad_output.shape[-1] == 1:
        torch.sum(rows * grad_output, 1, out=gradient.weight.squeeze(-1))
    else:
        torch.bmm(rows.mT, grad_output, out=gradient.weight)


def through_relu(layer: Dense, grad_output: Tensor, activation: Tensor) -> Tensor:
    """dL/d(input of the ReLU that made `activation`, the input of `layer`): [G, rows, in]."""
    rows = activation[:, : grad_output.shape[1]]
    return torch.bmm(grad_output, layer.weight.mT).mul_(rows > 0)
