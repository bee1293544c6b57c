"""A tiny team, learners on it and minibatches for it, shared by the tests of the learner."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import torch
from torch import Tensor

from msgdrop_cli.algorithms.dcc import DCC, Config
from msgdrop_cli.kernels.build import library
from msgdrop_cli.kernels.dcc import NAME
from msgdrop_cli.networks.stacked import initialise
from msgdrop_cli.ops.minibatch import Batch

AGENTS, OBSERVATION, ACTIONS = 3, 7, 5
KERNELS = (NAME, "torch")
TINY: Any = SimpleNamespace(
    agents=AGENTS,
    observation_size=OBSERVATION,
    observation_dtype=torch.uint8,
    actions=ACTIONS,
)
Array = npt.NDArray[np.float64]


def rand(*shape: int, seed: int) -> Tensor:
    """Uniform numbers in [0, 1)."""
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed))


def integers(below: int, *shape: int, seed: int) -> Tensor:
    """Uniform integers from 0 to below - 1."""
    return torch.randint(below, shape, generator=torch.Generator().manual_seed(seed))


def small_config(**changes: Any) -> Config:
    """Small networks that the C file knows, and a minibatch of as many transitions as actions."""
    small = {"f_units": (16, 32), "g_units": 48, "h_units": 16, "batch_size": 5}
    return Config(**{**small, **changes})


def make_learner(*configs: Config, seed: int = 1) -> DCC:
    """A learner whose target network is another one than the online network."""
    learner = DCC(configs, TINY)
    learner.initialise(rand(len(configs), learner.init_uniforms, seed=seed))
    initialise(learner.target, rand(len(configs), learner.init_uniforms, seed=seed + 1))
    return learner


def make_batch(learner: DCC, seed: int = 5) -> Batch:
    """Made by hand: small counts as observations, every action once, some true ends."""
    networks, size = learner.online.networks, learner.config.batch_size
    shown = learner.shown_agents.shape[1]
    return Batch(
        obs=integers(3, networks, 2 * size, shown, OBSERVATION, seed=seed).to(torch.uint8),
        action=torch.arange(size).remainder(ACTIONS).expand(networks, -1),
        reward=5.0 * rand(networks, size, seed=seed + 1),
        discount=(rand(networks, size, seed=seed + 2) < 0.8).float(),
    )


def mask_uniforms(learner: DCC, runs: int = 1, seed: int = 9) -> Tensor:
    """What an update takes for its mask, [R, update_uniforms]."""
    return rand(runs, learner.update_uniforms, seed=seed)


def weights_of(learner: DCC, part: str, network: int) -> dict[str, Array]:
    """Of one agent of run 0: `f1.weight` and so on, as numpy's float64."""
    tensors = learner.tensors(0).items()
    found = {name: view for name, view in tensors if name.startswith(part + ".")}
    return {n.removeprefix(part + "."): v[network].double().numpy() for n, v in found.items()}


def first_gradient(learner: DCC, layer: str) -> Tensor:
    """Of the bias of a layer after the first update, from Adam's moment: [G, outputs]."""
    return learner.adam.moments["exp_avg"][layer].bias[:, 0] / (1 - 0.9)


def use_kernel(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make learners compute in C or in torch; skips the test where there is no C."""
    if name == NAME and library() is None:
        pytest.skip("no C compiler, or MSGDROP_KERNEL=torch")
    if name == "torch":
        monkeypatch.setattr("msgdrop_cli.kernels.build._loaded", lambda: "not wanted")
