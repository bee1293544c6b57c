"""One agent's network as anybody would write it: `nn.Linear`, `nn.ReLU`, autograd."""

from collections.abc import Iterator
from itertools import pairwise

import torch
from torch import Tensor, nn

from msgdrop_cli.networks.fgh import FGH
from msgdrop_cli.networks.stacked import Network, Stacked


class SeparateFGH(nn.Module):
    """Q = h(f(o), g(m)), with ReLU on all but the last layer."""

    def __init__(self, f: list[int], g: list[int], h: list[int]) -> None:
        super().__init__()
        self.observation = f[0]
        self.f = nn.Sequential(nn.Linear(f[0], f[1]), nn.ReLU(), nn.Linear(f[1], f[2]), nn.ReLU())
        self.g = nn.Sequential(nn.Linear(g[0], g[1]), nn.ReLU())
        self.h = nn.Sequential(nn.Linear(h[0], h[1]), nn.ReLU(), nn.Linear(h[1], h[2]))

    def forward(self, inputs: Tensor) -> Tensor:
        """inputs: [B, (1 + S) * O], the own observation first; returns [B, A]."""
        own, messages = inputs[:, : self.observation], inputs[:, self.observation :]
        q: Tensor = self.h(torch.cat((self.f(own), self.g(messages)), -1))
        return q


def separate_perceptron(widths: list[int]) -> nn.Module:
    """Linear layers of these widths, with ReLU on all but the last one."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(widths[:-1]):
        layers += [nn.Linear(inputs, outputs), nn.ReLU()]
    return nn.Sequential(*layers, nn.Linear(widths[-2], widths[-1]))


def linears(module: nn.Module) -> Iterator[nn.Linear]:
    """The module's layers in the order of the stacked ones."""
    return (part for part in module.modules() if isinstance(part, nn.Linear))


def separate(network: Network, weights: Stacked, n: int) -> nn.Module:
    """A module with the sizes of `network` and the n-th of the stacked weights."""
    sizes = list(network.layers.values())
    module: nn.Module
    if isinstance(network, FGH):
        (observation, f1), (_, f2), g, (joint, h1), (_, actions) = sizes
        module = SeparateFGH([observation, f1, f2], list(g), [joint, h1, actions])
    else:
        module = separate_perceptron([sizes[0][0], *(outputs for _, outputs in sizes)])
    for layer, linear in zip(weights.views.values(), linears(module), strict=True):
        linear.weight.data.copy_(layer.weight[n].T)
        linear.bias.data.copy_(layer.bias[n, 0])
    return module
