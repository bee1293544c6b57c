"""How an encoder learns before the training: to say what is seen so that it can be seen again.

The squared error of the reconstruction, by Adam, with autograd; ours, the paper says "traditional
autoencoder" (l. 786). Letters: `B` batch, `O` observation.
"""

from collections.abc import Callable, Mapping

from torch import Tensor

from msgdrop_cli.algorithms.adam import Adam
from msgdrop_cli.messages.encoders import Autoencoder
from msgdrop_cli.networks.stacked import Stacked, initialise, parameter_count


class Reconstruction:
    """One encoder and its decoder."""

    def __init__(self, encoder: Autoencoder, observation: int, learning_rate: float) -> None:
        self._encoder, self._said = encoder, encoder.layers(observation)
        self._weights = Stacked({**self._said, **encoder.decoder(observation)}, 1)
        self.init_uniforms = parameter_count(self._weights.layers)
        self._adam = Adam(
            self._weights, learning_rate=learning_rate, max_gradient_norm=0.0, device="cpu"
        )

    def initialise(self, uniforms: Tensor) -> None:
        """New weights; uniforms [1, init_uniforms]."""
        initialise(self._weights, uniforms)

    def minimise(self, draw: Callable[[], Tensor]) -> None:
        """One step down the mean squared error of the observations that `draw` gives, [B, O]."""
        with self._adam.descent() as theta:
            obs = draw().float()[None]  # [1, B, O]
            error = self._seen_again(theta, obs) - obs
            error.square().mean().backward()

    def errors(self, obs: Tensor) -> Tensor:
        """The mean squared error of each number of obs [B, O]: [O]."""
        seen = obs.float()[None]
        return (self._seen_again(self._weights, seen) - seen).square().mean((0, 1))

    def tensors(self) -> Mapping[str, Tensor]:
        """All weights, [1, ...]; the encoder's are called as in `hearing.Encoding`."""
        return {
            f"{'encoder' if name.partition('.')[0] in self._said else 'decoder'}.{name}": view
            for name, view in self._weights.of_networks(0, 1).items()
        }

    def _seen_again(self, weights: Stacked, obs: Tensor) -> Tensor:
        said = self._encoder.message(weights.views, obs)
        return self._encoder.reconstruction(weights.views, said)
