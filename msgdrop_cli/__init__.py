"""msgdrop: train, break, compare and check message-dropout (Kim, Cho, Sung, AAAI-19).

What other programs may use stands here, and is loaded when it is asked for: the command line reads
the version without waiting for torch.
"""

from importlib import import_module
from typing import Any

__version__ = "0.2.0"
_PUBLIC = {
    "Policy": "msgdrop_cli.engine.policy",
    "load_policy": "msgdrop_cli.engine.policy",
    "MessageDropout": "msgdrop_cli.networks.message_dropout",
    "message_dropout": "msgdrop_cli.networks.message_dropout",
    "results": "msgdrop_cli.report.frames",
    "curves": "msgdrop_cli.report.frames",
}
"""Names and the modules that they come from; for type checkers they stand in `__init__.pyi`."""


def __getattr__(name: str) -> Any:
    """What a name of `_PUBLIC` stands for; AttributeError for any other."""
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PUBLIC[name]), name)
