"""Every product that the torch path asks of the matrix library: alone as stacked, bit for bit."""

from collections.abc import Sequence
from typing import Any

import pytest
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode

from msgdrop_cli.engine.training import Training
from tests.dcc_samples import rand, use_kernel
from tests.runs import planned

PRODUCTS = {torch.ops.aten.bmm, torch.ops.aten.baddbmm, torch.ops.aten.mm, torch.ops.aten.addmm}
CASES = [
    ("pursuit-n6", {"algorithm": name}) for name in ("fdc", "dcc-md", "full-sd", "concat-md")
] + [
    ("waterworld-n8", {"algorithm": name, "shares_parameters": shared})
    for name in ("ddpg", "vanilla-maddpg", "maddpg", "maddpg-md")
    for shared in (True, False)
]
CASES += [("pursuit-n8", {}), ("navigation-n8", {}), ("navigation-n10", {})]


class Spy(TorchDispatchMode):
    """Takes down the two factors of every matrix product."""

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self.seen: dict[tuple[Any, ...], tuple[Tensor, Tensor]] = {}

    def __torch_dispatch__(
        self, func: Any, types: Any, args: Sequence[Any] = (), kwargs: Any = None
    ) -> Any:
        """Do what was asked for."""
        if func.overloadpacket in PRODUCTS:
            left, right = args[-2:]
            key = (left.shape, left.stride(), right.shape, right.stride())
            self.seen[key] = (left, right)
        return func(*args, **(kwargs or {}))


def _products(environment: str, settings: dict[str, Any]) -> list[tuple[Tensor, Tensor]]:
    """The products of two stacked runs: acting, and updates of critic and actor."""
    run = planned(environment=environment, batch_size=32, **settings)
    training = Training([run.spec, run.spec])
    training.begin()
    with Spy() as spy:
        while training.learner.progress[0] < 2:
            training.advance()
    return list(spy.seen.values())


@pytest.mark.parametrize(("environment", "settings"), CASES)
def test_every_product_alone_and_stacked(
    environment: str, settings: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No column stands alone, which some processors add up otherwise; and the bits agree here."""
    use_kernel("torch", monkeypatch)
    products = _products(environment, settings)
    assert len(products) > 5
    for left, right in products:
        shapes = f"{tuple(left.shape)} times {tuple(right.shape)}"
        assert min(left.shape[-2], right.shape[-1]) > 1, shapes
        if left.dim() == 3:
            a, b = (2.0 * rand(*part.shape, seed=i) - 1.0 for i, part in enumerate((left, right)))
            a, b = torch.empty_like(left).copy_(a), torch.empty_like(right).copy_(b)
            stacked = torch.bmm(a, b)
            for g in range(len(a)):
                assert torch.equal(torch.bmm(a[g : g + 1], b[g : g + 1])[0], stacked[g]), shapes
