"""The program's own errors: one line for the user each, and the exit code that goes with it."""

import difflib
from collections.abc import Iterable


class MsgdropError(Exception):
    """Something the user can act on: says what was wrong, where, what was expected, what to do."""

    exit_code = 1


class DefinitionError(MsgdropError):
    """A definition, an override or an argument is wrong; nothing has been written."""

    exit_code = 2


class RunError(MsgdropError):
    """A run could not be trained or evaluated."""

    exit_code = 1


class RecordError(MsgdropError):
    """The results store cannot be read (2), created (73), written (74), or is in use (75)."""

    def __init__(self, message: str, exit_code: int = 2) -> None:
        super().__init__(message)
        self.exit_code = exit_code


def to_install(extra: str) -> str:
    """What brings an optional part: no package index has msgdrop, so it is typed in a checkout."""
    return f"in msgdrop's checkout: pip install -c constraints.txt -e '.[{extra}]'"


def nearest(name: str, known: Iterable[str]) -> str:
    """The tail of an error message that names the nearest known word, or all of them."""
    names = sorted(known)
    if close := closest(name, names):
        return f"did you mean {close!r}?"
    return "known: " + ", ".join(names)


def closest(name: str, known: Iterable[str]) -> str | None:
    """The known word that was probably meant, if one is near."""
    return next(iter(near(name, known)), None)


def near(name: str, known: Iterable[str]) -> list[str]:
    """Up to three known words that may have been meant, the likeliest first."""
    names = sorted(set(known))
    begun = [each for each in names if len(name) > 2 and each.startswith(name)]
    return (begun or difflib.get_close_matches(name, names))[:3]
