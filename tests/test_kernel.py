"""The compiled first layer against the plain torch path, which is its oracle."""

from pathlib import Path

import pytest
import torch

from msgdrop_cli.networks import kernel as kernel_module
from msgdrop_cli.networks.inputs import SparseInput, split_own
from msgdrop_cli.ops.message_dropout import apply_keep

pytestmark = pytest.mark.skipif(
    kernel_module.kernel() is None, reason="no C compiler, or MSGDROP_KERNEL=torch"
)

G, B, J, O, H = 3, 10, 4, 147, 96  # noqa: E741 - the legend's letters (design)


def _case(unit: int) -> tuple[SparseInput, torch.Tensor]:
    """Bytes of which about 8% are not zero, factors of 0, 1 and between, and the dense product."""
    random = torch.Generator().manual_seed(unit)
    ones = torch.rand(G, B, J, O, generator=random) < 0.08
    blocks = (ones * torch.randint(1, 6, ones.shape, generator=random)).to(torch.uint8)
    factor = torch.randint(0, 3, (G, B, J, unit), generator=random) * 0.5
    return SparseInput(blocks, factor), apply_keep(blocks.float(), factor).flatten(2)


def _normal(*shape: int, seed: int) -> torch.Tensor:
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("unit", [1, O])
def test_forward_is_the_dense_product(unit: int) -> None:
    """A whole layer equals baddbmm on the multiplied-out input."""
    inputs, dense = _case(unit)
    weight, bias = _normal(G, J * O, H, seed=3), _normal(G, 1, H, seed=4)
    expected = torch.baddbmm(bias, dense, weight)
    torch.testing.assert_close(inputs.times(weight, bias), expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("unit", [1, O])
def test_gradient_is_the_dense_product(unit: int) -> None:
    """The weight's gradient equals bmm, for the first rows only and over old contents."""
    inputs, dense = _case(unit)
    grad_output = _normal(G, 7, H, seed=5)
    out = torch.full((G, J * O, H), 9.0)
    inputs.gradient(grad_output, out)
    expected = torch.bmm(dense[:, :7].mT, grad_output)
    torch.testing.assert_close(out, expected, rtol=1e-5, atol=1e-5)


def test_parts_of_an_input_are_read_in_place() -> None:
    """The own block, the messages and later rows are views with the right strides."""
    inputs, dense = _case(1)
    own, messages = split_own(inputs, O)
    weight, bias = _normal(G, J * O, H, seed=6), torch.zeros(G, 1, H)
    assert isinstance(own, SparseInput)
    assert isinstance(messages, SparseInput)
    later = SparseInput(messages.blocks[:, 4:], messages.factor[:, 4:])
    for part, expected in (
        (own, torch.bmm(dense[..., :O], weight[:, :O])),
        (later, torch.bmm(dense[:, 4:, O:], weight[:, O:])),
    ):
        shape = part.blocks.shape[2] * O
        layer = weight[:, :O] if shape == O else weight[:, O:]
        found = part.times(layer.contiguous(), bias)
        torch.testing.assert_close(found, expected, rtol=1e-5, atol=1e-5)


def test_the_torch_path_can_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    """MSGDROP_KERNEL=torch loads nothing."""
    monkeypatch.setenv("MSGDROP_KERNEL", "torch")
    assert kernel_module.kernel.__wrapped__() is None
    assert kernel_module.kernel() is not None


def test_a_torn_library_is_built_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A truncated file in the cache is never loaded; it would kill the process."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("MSGDROP_KERNEL", raising=False)
    assert kernel_module.kernel.__wrapped__() is not None
    [library] = (tmp_path / "msgdrop").glob("*.so")
    whole = library.read_bytes()
    library.unlink()  # another file: the one above is in use by this process
    library.write_bytes(whole[:2000])
    assert kernel_module.kernel.__wrapped__() is not None
    assert library.read_bytes() == whole


def test_no_compiler_and_no_home_leave_the_torch_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing to compile with, or nowhere to keep it, is no error."""
    with monkeypatch.context() as patch:
        patch.setenv("PATH", "")
        assert kernel_module.kernel.__wrapped__() is None
    with monkeypatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", "/proc/nowhere")
        assert kernel_module.kernel.__wrapped__() is None
