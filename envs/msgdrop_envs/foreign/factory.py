"""Finds `package.module:factory` and calls it, if the user has asked for this very factory.

It is code from anywhere, and a record from anywhere may name it. So what is not named in
`MSGDROP_FACTORIES` is refused here, where every way to it comes along: `--env` and the folder of a
run are such a wish, a folder full of records is none. Worker processes inherit it.
"""

import importlib
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

from msgdrop_envs.registry import GameError

FACTORY = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*:[A-Za-z_]\w*", re.ASCII)
"""`package.module:factory`."""
_WISH = "MSGDROP_FACTORIES"


def allow(factory: str) -> None:
    """Let this factory be called, in this process and in those that it starts."""
    os.environ[_WISH] = ",".join(dict.fromkeys([*_allowed(), factory]))


def is_allowed(factory: str) -> bool:
    """Whether the user has asked for it."""
    return factory in _allowed()


def refuse_unasked(factory: str) -> None:
    """GameError, which says how to ask, unless the user has asked for this factory."""
    if not is_allowed(factory):
        asking = f"say {_WISH}={factory}, or eval the run's own folder"
        raise GameError(f"{factory}: is other people's code, and not played unasked; {asking}")


def make(factory: str) -> Any:
    """Call the factory; what it gives is looked at elsewhere.

    A module beside which the user stands is found as well, after all that is installed. Raises
    GameError, in one line: not asked for, cannot be imported, or fails.
    """
    refuse_unasked(factory)
    if not FACTORY.fullmatch(factory):
        raise GameError(f"{factory[:64]!r}: expected package.module:factory")
    module, _, name = factory.partition(":")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    with theirs(factory, "makes no game"):
        return getattr(importlib.import_module(module), name)()


@contextmanager
def theirs(factory: str, problem: str) -> Iterator[None]:
    """Other people's code, in the block: what it prints goes where it spoils no result, to stderr.

    Raises GameError, in one line, for whatever it raises, a wish to end the program included.
    """
    try:
        with redirect_stdout(sys.stderr):
            yield
    except GameError:
        raise
    except (Exception, SystemExit) as error:
        said = " ".join(str(error).split())
        raise GameError(f"{factory}: {problem}: {type(error).__name__}: {said}") from error


def _allowed() -> list[str]:
    return [each for each in os.environ.get(_WISH, "").split(",") if each]
