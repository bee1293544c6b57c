"""Stacked networks are what separate `nn.Module`s are: sizes, values, first weights."""

import math

import pytest
import torch
from torch import nn

from msgdrop_cli.networks.fgh import FGH
from msgdrop_cli.networks.perceptron import Perceptron
from msgdrop_cli.networks.stacked import Network, Stacked, initialise, parameter_count
from tests.separate_networks import separate

OBSERVATION, SENDERS, ACTIONS, NETWORKS, BATCH = 7, 3, 5, 4, 6
INPUTS = OBSERVATION * (1 + SENDERS)


def _fgh() -> Network:
    return FGH(
        *(OBSERVATION, OBSERVATION, SENDERS, ACTIONS),
        f_units=(9, 8),
        g_units=10,
        h_units=11,
    )


def _perceptron() -> Network:
    return Perceptron(INPUTS, SENDERS, (9, 8, 11), ACTIONS)


def _stacked(network: Network, seed: int = 1) -> Stacked:
    weights = Stacked(network.layers, NETWORKS)
    count = NETWORKS * parameter_count(network.layers)
    initialise(weights, torch.rand(1, count, generator=torch.Generator().manual_seed(seed)))
    return weights


@pytest.mark.parametrize(
    ("agents", "units", "expected"), [(6, 96, 88_053), (8, 128, 150_261)], ids=["n6", "n8"]
)
def test_fgh_has_the_papers_parameters(agents: int, units: int, expected: int) -> None:
    """147-64-48, (N-1)*147-96 (or 128), 144-32-5 (or 176): figure 8's and l. 745-751's sizes."""
    network = FGH(147, 147, agents - 1, 5, f_units=(64, 48), g_units=units, h_units=32)
    assert parameter_count(network.layers) == expected


def test_fdc_has_the_papers_parameters() -> None:
    """147-64-48-32-5 (l. 750)."""
    assert parameter_count(Perceptron(147, 0, (64, 48, 32), 5).layers) == 14_325


@pytest.mark.parametrize(("agents", "expected"), [(6, 61_365), (8, 80_181)])
def test_concat_has_fdcs_widths_on_everything(agents: int, expected: int) -> None:
    """N*147-64-48-32-5: FDC plus (N-1)*147*64 weights."""
    network = Perceptron(agents * 147, agents - 1, (64, 48, 32), 5)
    assert parameter_count(network.layers) == expected == 14_325 + (agents - 1) * 147 * 64


def test_stacked_holds_the_parameters_and_padding_only() -> None:
    """The flat tensor is the sum of its views, padded with zeros to a multiple of 64."""
    weights = _stacked(_fgh())
    views = weights.of_networks(0, NETWORKS)
    count = sum(view.numel() for view in views.values())
    assert count == NETWORKS * parameter_count(_fgh().layers)
    assert weights.flat.numel() % 64 == 0
    assert 0 < weights.flat.numel() - count < 64
    for view in views.values():
        view.zero_()
    assert not weights.flat.any()


@pytest.mark.parametrize("network", [_fgh(), _perceptron()], ids=["fgh", "perceptron"])
def test_stacked_forward_equals_separate_modules(network: Network) -> None:
    """Network n on inputs n gives what its own nn.Module gives."""
    weights = _stacked(network)
    inputs = torch.randn(NETWORKS, BATCH, INPUTS, generator=torch.Generator().manual_seed(2))
    q = network.forward(weights, inputs)
    expected = [separate(network, weights, n)(one) for n, one in enumerate(inputs)]
    torch.testing.assert_close(q, torch.stack(expected), rtol=1e-5, atol=1e-6)


def test_of_networks_cuts_out_the_right_networks() -> None:
    """The views of networks 1 and 2 are those networks' weights, writable in place."""
    network = _fgh()
    weights = _stacked(network)
    before = weights["g1"].weight.clone()
    part = weights.of_networks(1, 3)
    assert set(part) == {f"{n}.{p}" for n in network.layers for p in ("weight", "bias")}
    part["g1.weight"].zero_()
    assert not weights["g1"].weight[1:3].any()
    assert torch.equal(weights["g1"].weight[[0, 3]], before[[0, 3]])


def test_initial_weights_are_torchs_default() -> None:
    """Uniform between -1/sqrt(inputs) and 1/sqrt(inputs), weights and biases alike."""
    network = FGH(147, 147, 5, 5, f_units=(64, 48), g_units=96, h_units=32)
    weights = Stacked(network.layers, 6)
    count = 6 * parameter_count(network.layers)
    initialise(weights, torch.rand(1, count, generator=torch.Generator().manual_seed(4)))
    for name, (inputs, _) in network.layers.items():
        bound = 1 / math.sqrt(inputs)
        flat = torch.cat([part.flatten() for part in weights[name]])
        assert flat.abs().max() <= bound
        assert abs(flat.mean().item()) < 5 * bound / math.sqrt(3 * flat.numel())
        assert flat.std().item() == pytest.approx(bound / math.sqrt(3), rel=0.05)
    torch.manual_seed(0)
    layer = nn.Linear(147, 4_000)
    assert layer.weight.abs().max().item() == pytest.approx(1 / math.sqrt(147), rel=1e-3)
    assert layer.bias.abs().max().item() == pytest.approx(1 / math.sqrt(147), rel=1e-2)


def test_no_two_networks_share_an_initial_number() -> None:
    """Each of the R*N networks takes numbers of its own: run r's come from row r."""
    network = _fgh()
    count = parameter_count(network.layers)
    weights = Stacked(network.layers, 4)
    numbers = torch.arange(4.0 * count).view(2, 2 * count) / (4 * count)
    initialise(weights, numbers)
    rescaled = [
        (view * math.sqrt(network.layers[name.split(".")[0]][0]) + 1) / 2 * 4 * count
        for name, view in weights.of_networks(0, 4).items()
    ]
    runs = torch.cat([part.reshape(2, -1) for part in rescaled], 1).round().long()
    assert runs.sort(1).values.flatten().tolist() == list(range(4 * count))
