"""A CUDA graph on the CPU: tensor operations taken down and done again, blindly.

Like a graph, a tape knows nothing of what the host meant. It repeats the same operators with the
same numbers on the same tensors, so whatever was taken from a counter of the host comes out stale.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import pytest
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

ASKING = (torch.Tag.data_dependent_output, torch.Tag.dynamic_output_shape)
"""Torch's own words for operators for whose result the host has to wait."""
INDEXING = ("aten::index", "aten::index_put", "aten::index_put_", "aten::_index_put_impl_")
FROM_HOST = ("aten::lift_fresh", "aten::lift_fresh_copy", "aten::set_.source_Storage")


class Call(NamedTuple):
    """One operator, what it was given and what it gave."""

    operator: Any
    args: Any
    kwargs: Any
    result: Any

    def waits(self) -> bool:
        """Whether a GPU could not do this within a captured graph."""
        name = self.operator._schema.name
        if name in INDEXING:  # waits only where a mask says which
            return any(
                isinstance(leaf, Tensor) and leaf.dtype in (torch.bool, torch.uint8)
                for leaf in tree_leaves(self.args[1])
            )
        return name in FROM_HOST or any(tag in self.operator.tags for tag in ASKING)


class Tape(TorchDispatchMode):
    """Takes down the operators that are called within its context."""

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self.calls: list[Call] = []

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        """Do it, and remember it."""
        result = func(*args, **(kwargs or {}))
        self.calls.append(Call(func, args, kwargs or {}, result))
        return result

    def waiting(self) -> set[str]:
        """The operators that no graph can hold."""
        return {str(call.operator) for call in self.calls if call.waits()}

    def launches(self) -> int:
        """Operators that compute something: on a GPU a kernel each, or two."""
        return sum(not _is_view(call) for call in self.calls)

    def play(self) -> None:
        """Do it all again."""
        for call in self.calls:
            again = call.operator(*call.args, **call.kwargs)
            for old, new in zip(tree_leaves(call.result), tree_leaves(again), strict=True):
                if isinstance(old, Tensor) and old.data_ptr() != new.data_ptr():
                    old.copy_(new)


def _is_view(call: Call) -> bool:
    """Whether the operator only looks at what is there in another way, or only writes a note."""
    name, returns = call.operator._schema.name, call.operator._schema.returns
    looks = any(each.alias_info is not None and not each.alias_info.is_write for each in returns)
    return looks or name == "aten::_unsafe_view" or name.startswith("profiler::")


class Tapes:
    """A Recorder (engine/graphs.py) of tapes."""

    def __init__(self) -> None:
        self.tapes: list[Tape] = []
        self.repeated = 0

    def record(self, body: Callable[[], None]) -> Callable[[], None]:
        """Taking down is doing, here, so the first repetition has happened."""
        tape = Tape()
        with tape:
            body()
        self.tapes.append(tape)
        done = iter([True])

        def repeat() -> None:
            if not next(done, False):
                self.repeated += 1
                tape.play()

        return repeat

    def send(self, tensor: Tensor) -> Callable[[], Tensor]:
        """The numbers of this moment; `Chunks` gives a tensor that nobody changes."""
        return lambda: tensor


def be_a_device(monkeypatch: pytest.MonkeyPatch) -> None:
    """The CPU does as a GPU must: nothing is asked in passing, and no C kernel hides."""
    monkeypatch.setattr("msgdrop_envs.waiting.can_ask", lambda tensor: False)
    without_c(monkeypatch)


def without_c(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute in torch alone, as a GPU does; a tape does not see what C does."""
    monkeypatch.setattr("msgdrop_cli.kernels.build._loaded", lambda: "not wanted")
