"""Networks that Adam moves and a target that follows softly (`tau`), for actors and critics."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import torch
from torch import Tensor

from msgdrop_cli.algorithms.adam import Adam
from msgdrop_cli.networks.stacked import Layers, Stacked, initialise


class SoftTarget:
    """Online and target weights of `networks` equal networks, and Adam for the online ones."""

    def __init__(
        self,
        layers: Layers,
        networks: int,
        learning_rate: float,
        max_gradient_norm: float,
        tau: float,
        device: torch.device | str,
    ) -> None:
        self._tau = tau
        self.online = Stacked(layers, networks, device)
        self.target = Stacked(layers, networks, device)
        self.adam = Adam(
            self.online,
            learning_rate=learning_rate,
            max_gradient_norm=max_gradient_norm,
            device=device,
        )

    def initialise(self, uniforms: Tensor) -> None:
        """New weights, online and target alike; uniforms [R, parameters of a run]."""
        initialise(self.online, uniforms)
        self.target.flat.copy_(self.online.flat)

    @contextmanager
    def descent(self) -> Iterator[Stacked]:
        """Adam's `descent`; then the target follows by the share `tau`."""
        with self.adam.descent() as weights:
            yield weights
        self.target.flat.lerp_(self.online.flat, self._tau)

    def parts(self) -> Mapping[str, Stacked]:
        """What training goes on from."""
        return {"online": self.online, "target": self.target, **self.adam.moments}
