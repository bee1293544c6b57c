"""Weights of G = R*N equal networks in one flat tensor, and the dense layer over them.

One flat tensor means one Adam step and one target copy for everything. It is padded to whole
SIMD registers, so that no number is handled in a loop's tail: a run's bits must not depend on how
many runs it is stacked with (test_independence).
"""

import math
from collections.abc import Mapping
from typing import NamedTuple, Protocol

import torch
from torch import Tensor

Layers = Mapping[str, tuple[int, int]]
"""Layer name to (inputs, outputs)."""


class Dense(NamedTuple):
    """One layer's weight [G, inputs, outputs] and bias [G, 1, outputs]: views of `flat`."""

    weight: Tensor
    bias: Tensor


class Stacked:
    """The weights (or gradients, or moments) of G networks: `flat`, and views by layer name."""

    def __init__(
        self,
        layers: Layers,
        networks: int,
        device: torch.device | str = "cpu",
        *,
        flat: Tensor | None = None,
    ) -> None:
        """Zeros, or views of `flat`, which is as long as another Stacked's of the kind."""
        self.layers = layers
        self.networks = networks
        shapes = [(networks, *s) for i, o in layers.values() for s in ((i, o), (1, o))]
        sizes = [math.prod(shape) for shape in shapes]
        padding = -sum(sizes) % 64
        # Made outside inference mode, in which training runs: its tensors autograd refuses.
        with torch.inference_mode(False):
            self.flat = torch.zeros(sum(sizes) + padding, device=device) if flat is None else flat
            # One split: its backward pass puts all gradients together at once.
            parts = self.flat.split([*sizes, padding])[:-1]
            views = [part.view(shape) for part, shape in zip(parts, shapes, strict=True)]
        self.views = {name: Dense(*views[2 * n : 2 * n + 2]) for n, name in enumerate(layers)}

    def leaf(self) -> "Stacked":
        """The same numbers in the same place, as a leaf of autograd, which collects a gradient."""
        return Stacked(self.layers, self.networks, flat=self.flat.detach().requires_grad_())

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
    senders: int
    """S, the senders whose messages are among its inputs."""

    def forward(self, weights: Stacked, inputs: Tensor) -> Tensor:
        """Q [G, B, A] of the inputs [G, B, O + S*M]."""


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


def dense(layer: Dense, inputs: Tensor) -> Tensor:
    """Inputs [G, B, in] times weight plus bias: [G, B, out].

    One column is no business of the matrix library: it takes a matrix-vector routine if G is 1, and
    on some processors that one adds up in another order (test_products).
    """
    if layer.weight.shape[-1] == 1:
        return (inputs * layer.weight.mT).sum(-1, keepdim=True) + layer.bias
    return torch.baddbmm(layer.bias, inputs, layer.weight)
