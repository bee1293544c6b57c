"""Whether the host may put a question to a tensor in passing.

On the CPU `if tensor.any():` costs nothing, and the answer can save much work. A GPU would have to
finish all that it was told before, and a step captured in a CUDA graph cannot ask at all. So what
saves work asks here first; the result is the same either way (tests/test_graphs.py).
"""

from torch import Tensor


def can_ask(tensor: Tensor) -> bool:
    """Whether the tensor's numbers are known to the host by now."""
    return tensor.device.type == "cpu"
