"""What every learner needs to serve the runs of a cohort."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import torch
from torch import Tensor

ConfigT = TypeVar("ConfigT", bound=Any)


def shared_config(configs: Sequence[ConfigT]) -> ConfigT:
    """The Config that stands for all runs; ValueError if they differ in more than `rate`."""
    if any(replace(each, rate=configs[0].rate) != configs[0] for each in configs):
        raise ValueError("the runs of a cohort may differ in rate only")
    return configs[0]


def shown_agents(agents: int, senders: int, device: torch.device | str) -> Tensor:
    """Row i: agent i, then its senders in increasing order (the paper's m^i, l. 149): [N, 1+S]."""
    rows = [[i, *(j for j in range(agents) if j != i)] for i in range(agents)]
    return torch.tensor(rows, device=device)[:, : 1 + senders]
