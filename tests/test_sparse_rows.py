"""Rows without their zeros against torch's products."""

import pytest
import torch

from msgdrop_cli.algorithms.maddpg import MADDPG, Config
from msgdrop_cli.networks import sparse_rows as module
from msgdrop_cli.networks.sparse_rows import SparseRows, matmul, matmul_gradient, sparse_rows
from tests.dcc_samples import rand
from tests.maddpg_samples import TINY

NETWORKS, ROWS = 2, 9


@pytest.fixture(autouse=True)
def compiled() -> None:
    """Without a compiler there is nothing to compare."""
    if not isinstance(sparse_rows(torch.zeros(1, 1, 1)), SparseRows):
        pytest.skip("no C compiler")


@pytest.mark.parametrize("outputs", [1, 5, 16, 40, 64, 100, 200])
@pytest.mark.parametrize("units", [1, 7, 8, 154])
@pytest.mark.parametrize("share", [0.0, 0.06, 1.0])
def test_products_equal_torchs(outputs: int, units: int, share: float) -> None:
    """Outputs with and without bias, and the weights' gradient, whatever is 0."""
    x = rand(NETWORKS, ROWS, units, seed=1) - 0.5
    x = x * (rand(NETWORKS, ROWS, units, seed=2) < share)
    weight = rand(NETWORKS, units, outputs, seed=3) - 0.5
    bias, grad = rand(NETWORKS, 1, outputs, seed=4), rand(NETWORKS, ROWS, outputs, seed=5)
    rows = SparseRows(x)
    torch.testing.assert_close(rows.times(weight, bias), torch.baddbmm(bias, x, weight))
    torch.testing.assert_close(matmul(rows, weight), x @ weight)
    torch.testing.assert_close(matmul_gradient(rows, grad), x.mT @ grad)


def test_what_is_not_finite_goes_through() -> None:
    """A run that diverges is seen to: nothing that is no number counts as 0."""
    rows = SparseRows(torch.tensor([[[0.0, torch.nan, 1.0]]]))
    assert rows.times(torch.ones(1, 3, 17), None).isnan().all()
    weight = torch.ones(1, 3, 17)
    weight[0, 2] = torch.inf
    assert (SparseRows(torch.ones(1, 1, 3)).times(weight, None) == torch.inf).all()


def test_a_network_has_the_bits_that_it_has_alone() -> None:
    """Stacked or not, and among however many rows."""
    x, weight = rand(3, ROWS, 20, seed=6), rand(3, 20, 100, seed=7)
    together = matmul(sparse_rows(x), weight)
    assert torch.equal(matmul(sparse_rows(x[1:2]), weight[1:2]), together[1:2])
    assert torch.equal(matmul(sparse_rows(x[:, :4]), weight), together[:, :4])


def test_without_a_compiler_rows_stay_a_tensor(monkeypatch: pytest.MonkeyPatch) -> None:
    """Then torch multiplies; so it does on every other device."""
    x = rand(1, 2, 3, seed=8)
    assert isinstance(sparse_rows(x.to("meta")), torch.Tensor)
    monkeypatch.setattr(module, "_library", lambda: None)
    assert sparse_rows(x) is x


def test_the_record_says_what_multiplies(monkeypatch: pytest.MonkeyPatch) -> None:
    """A resume insists on it: sums are taken in another order without the C file."""
    apart = Config(shares_parameters=False)  # nothing else is compiled of it
    assert MADDPG.kernel(apart, TINY, "meta") == "torch"
    for found, name in ((object(), "c-sparse-rows"), (None, "torch")):
        monkeypatch.setattr("msgdrop_cli.networks.sparse_rows._library", lambda found=found: found)
        assert MADDPG.kernel(apart, TINY, "cpu") == name
