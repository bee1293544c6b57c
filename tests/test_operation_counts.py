"""A speed gate that cannot flake: operator calls and allocated bytes of a step, never seconds.

For networks this small the number of operator calls is what a step costs beside its arithmetic.
A bound that is passed says that somebody made the loop slower; one that is missed by far should
be lowered.
"""

from collections.abc import Callable, Iterable
from typing import Any

import pytest
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode

from msgdrop_cli.engine.training import Training
from msgdrop_cli.kernels.dcc import NAME
from tests.dcc_samples import use_kernel
from tests.runs import planned

PARTS = ("act", "play", "sample", "learn")
CALLS = {
    (NAME, "pursuit-n6"): (16, 104, 8, 19),
    ("torch", "pursuit-n6"): (32, 104, 8, 205),
    (NAME, "navigation-n8"): (16, 114, 8, 19),
    ("torch", "navigation-n8"): (32, 114, 8, 205),
    (NAME, "waterworld-n8"): (17, 215, 7, 16),
    ("torch", "waterworld-n8"): (23, 215, 7, 265),
}
"""Operator calls of each part, at most: of one step of 8 games, and of one update."""
KILOBYTES = {
    (NAME, "pursuit-n6"): (4, 40, 8, 22),
    ("torch", "pursuit-n6"): (500, 40, 8, 31_000),
    (NAME, "navigation-n8"): (6, 96, 10, 40),
    ("torch", "navigation-n8"): (300, 96, 10, 16_500),
    (NAME, "waterworld-n8"): (9, 380, 2, 34),
    ("torch", "waterworld-n8"): (42, 380, 2, 20_000),
}
"""Kilobytes of new tensors, likewise."""


class Count(TorchDispatchMode):
    """Counts operator calls, and the bytes of the tensors that they make."""

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self.calls = self.bytes = 0

    def __torch_dispatch__(
        self, func: Any, types: Iterable[type], args: Any = (), kwargs: Any = None
    ) -> Any:
        """Run the operator and take note of it."""
        result = func(*args, **(kwargs or {}))
        self.calls += 1
        if isinstance(result, Tensor) and not (func.is_view or func._schema.is_mutable):
            self.bytes += result.nbytes
        return result


def _counts(training: Training) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Calls and kilobytes of the parts; the least of four, without the blocks of random numbers."""
    actions, batch = training.act(), training.sample()
    parts: dict[str, Callable[[], Any]] = {
        "act": training.act,
        "play": lambda: training.play(actions),
        "sample": training.sample,
        "learn": lambda: training.learn(batch),
    }
    calls, kilobytes = [], []
    for name in PARTS:
        counts = [Count() for _ in range(4)]
        for count in counts:
            with count:
                parts[name]()
        calls.append(min(count.calls for count in counts))
        kilobytes.append(min(count.bytes for count in counts) // 1024)
    return tuple(calls), tuple(kilobytes)


@pytest.mark.parametrize(("kernel", "environment"), CALLS)
def test_a_step_makes_no_more_operator_calls(
    kernel: str, environment: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Calls and new bytes of acting, playing, sampling and learning stay within their bounds."""
    use_kernel(kernel, monkeypatch)
    algorithm = "maddpg-md" if environment == "waterworld-n8" else "dcc-md"
    run = planned(algorithm, environment=environment, replay_capacity=2_000)
    training = Training([run.spec])
    training.begin()
    with torch.no_grad():
        for _ in range(20):
            training.advance()
        calls, kilobytes = _counts(training)
    case = (kernel, environment)
    assert all(found <= most for found, most in zip(calls, CALLS[case], strict=True)), calls
    limits = zip(kilobytes, KILOBYTES[case], strict=True)
    assert all(found <= most for found, most in limits), kilobytes
