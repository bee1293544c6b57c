"""What every learner needs to serve the runs of a cohort."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import torch
from torch import Tensor

from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.messages.topologies import Senders
from msgdrop_cli.networks.stacked import Stacked

TORCH = "torch-autograd"
"""The kernel's name in the records where a learner's own page computes."""
ConfigT = TypeVar("ConfigT", bound=Any)


def check_ranges(
    config: Any, *, shares: Sequence[str], amounts: Sequence[str], counts: Sequence[str]
) -> None:
    """ValueError with the name of the first field that is out of its range; NaN always is.

    shares lie between 0 and 1, amounts are not negative, counts at least 1; what every learner's
    Config has is checked in any case.
    """
    for name in ("rate", "gamma", *shares):
        if not 0.0 <= getattr(config, name) <= 1.0:
            raise ValueError(f"{name} must be between 0 and 1, not {getattr(config, name)}")
    for name in ("learning_rate", "max_gradient_norm", "replay_start_env_steps", *amounts):
        if not getattr(config, name) >= 0:
            raise ValueError(f"{name} must not be negative, not {getattr(config, name)}")
    common = ("g_units", "h_units", "batch_size", "replay_capacity", "update_every_env_steps")
    for name in (*common, *counts):
        if not getattr(config, name) >= 1:
            raise ValueError(f"{name} must be at least 1, not {getattr(config, name)}")
    if not min(config.f_units) >= 1:
        raise ValueError(f"f_units must be at least 1 each, not {list(config.f_units)}")


def shared_config(configs: Sequence[ConfigT], agents: int) -> ConfigT:
    """The Config that stands for all runs; ValueError if they differ in more than `rate`.

    Raises DefinitionError if its network would hear others and the only agent has none.
    """
    if agents == 1 and configs[0].network != "own":
        raise DefinitionError("one agent alone has nobody to hear; take fdc or ddpg")
    if any(replace(each, rate=configs[0].rate) != configs[0] for each in configs):
        raise ValueError("the runs of a cohort may differ in rate only")
    return configs[0]


def shown_agents(heard: Senders, device: torch.device | str) -> Tensor:
    """Row i: agent i, then whom it hears (the paper's m^i, l. 149): [N, 1+S] int64."""
    return torch.tensor([[i, *senders] for i, senders in enumerate(heard)], device=device)


def shown_received(links: Tensor) -> Tensor:
    """As `shown_agents`, but of N observations followed by N*(N-1) messages: [N, 1+S] int64.

    links: [N, S], where those who are heard stand among all others.
    """
    agent = torch.arange(len(links), device=links.device)[:, None]
    return torch.cat((agent, len(links) + agent * (len(links) - 1) + links), 1)


class RunningMeans:
    """Of the losses and Q-values of every run, since they were taken last."""

    def __init__(self, runs: int, device: torch.device | str) -> None:
        self.sums = torch.zeros(2, runs, device=device)
        """[2, R], part of a run's tensors."""
        self.updates = 0

    def add(self, loss: Tensor, q: Tensor) -> None:
        """One update's numbers; the first dimension of each is the networks, run by run."""
        runs = self.sums.shape[1]
        self.sums[0].add_(loss.reshape(runs, -1).mean(1))
        self.sums[1].add_(q.reshape(runs, -1).mean(1))
        self.updates += 1

    def take(self) -> list[dict[str, float | None]]:
        """Each run's means, by name; None without an update."""
        learnt = self.updates > 0
        means = (self.sums / max(self.updates, 1)).T.tolist()
        self.sums.zero_()
        self.updates = 0
        return [{"loss": loss if learnt else None, "q": q if learnt else None} for loss, q in means]


def tensors_of(parts: Mapping[str, Stacked], first: int, last: int) -> dict[str, Tensor]:
    """Views of the networks `first` to `last - 1` of every part, by `part.layer.weight`."""
    return {
        f"{part}.{name}": view
        for part, stacked in parts.items()
        for name, view in stacked.of_networks(first, last).items()
    }
