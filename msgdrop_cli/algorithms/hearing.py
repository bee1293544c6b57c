"""Whom the agents of a cohort hear, and what these say of what they see."""

from collections.abc import Mapping
from typing import Protocol

import torch
from torch import Tensor

from msgdrop_cli.messages.encoders import OBSERVATION, encoder_of
from msgdrop_cli.messages.topologies import Senders, senders
from msgdrop_cli.networks.stacked import Stacked


class Config(Protocol):
    """What a learner's Config says of it."""

    @property
    def network(self) -> str:
        """With "own" nobody is heard."""

    @property
    def topology(self) -> str:
        """A file in `messages/topologies`."""

    @property
    def encoder(self) -> str:
        """A file in `messages/encoders`."""

    @property
    def encoder_samples(self) -> int:
        """Observations that it learns from."""


def heard(config: Config, agents: int) -> Senders:
    """Whom each agent hears, [N, S]."""
    return [[]] * agents if config.network == "own" else senders(config.topology, agents)


def said(config: Config) -> str:
    """The encoder of what is heard."""
    return OBSERVATION if config.network == "own" else config.encoder


def encoding_of(
    config: Config, observation: int, runs: int, device: torch.device | str
) -> "Encoding":
    """The Encoding of a cohort's messages, about observations of so many numbers."""
    samples = config.encoder_samples
    return Encoding(said(config), observation, runs, device, samples=samples)


class Encoding:
    """An encoder and its weights, one set a run, which training leaves as they are."""

    def __init__(
        self,
        name: str,
        observation: int,
        runs: int,
        device: torch.device | str,
        *,
        samples: int = 0,
    ) -> None:
        """Weights of 0, until they are filled in; samples: what they are to be learnt from."""
        self.name, self.samples = name, samples
        self._encoder = encoder_of(name)
        self.apart = name != OBSERVATION
        """Whether messages are other numbers than observations, so that they are stored, too."""
        self.width = self._encoder.width(observation)
        """M, the numbers of a message."""
        self._runs = runs
        self._weights = Stacked(self._encoder.layers(observation), runs, device)

    @property
    def learns(self) -> bool:
        """Whether there is something to fill in before training begins."""
        return bool(self._weights.layers)

    def fill(self, weights: Mapping[str, Tensor]) -> None:
        """Give every run these weights, named as in `tensors`; KeyError if one is missing."""
        for run in range(self._runs):
            for name, view in self.tensors(run).items():
                view.copy_(weights[name])

    def message(self, obs: Tensor) -> Tensor | None:
        """What the agents say, [R, E, N, M] float32; None if it is obs [R, E, N, O] itself."""
        if not self.apart:
            return None
        said = self._encoder.message(self._weights.views, obs.flatten(1, 2))  # [R, E*N, M]
        return said.view(*obs.shape[:3], self.width)

    def with_messages(self, obs: Tensor, old: Tensor | None) -> tuple[Tensor, Tensor | None]:
        """Observations [R, E, K, O] and messages [R, E, K, M], None where they are the same.

        old: None for what is said now, K = N; else [R, E, N, S, M], what arrives of this step's and
        earlier messages, K = N + N*S: they lie behind the first N.
        """
        if old is None:
            return obs, self.message(obs)
        behind = old.flatten(2, 3)
        if self.apart:
            return obs, torch.cat((behind[:, :, : obs.shape[2]], behind), 2)
        return torch.cat((obs, behind), 2), None

    def turned_to_numbers(self, obs: Tensor, old: Tensor) -> bool:
        """Whether a channel made numbers of messages that were bytes, as no kernel reads them."""
        return not self.apart and old.dtype != obs.dtype

    def tensors(self, run: int) -> Mapping[str, Tensor]:
        """The weights of one run, as views; a policy is nothing without them."""
        views = self._weights.of_networks(run, run + 1).items()
        return {f"encoder.{name}": view for name, view in views}
