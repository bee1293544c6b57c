"""The program's own errors: one line for the user each, and the exit code that goes with it."""

import difflib
import errno
from collections.abc import Iterable, Sequence

DISK_FAULTS = (errno.EIO, errno.ENOSPC, errno.EDQUOT)
"""Faults of the machine."""


class MsgdropError(Exception):
    """Something the user can act on: says what was wrong, where, what was expected, what to do."""

    exit_code = 1


class DefinitionError(MsgdropError):
    """A definition, an override or an argument is wrong; nothing has been written."""

    exit_code = 2


class DefinitionErrors(DefinitionError):
    """Several mistakes that are told together, a line each; as a text it is the first."""

    def __init__(self, errors: Sequence[DefinitionError]) -> None:
        super().__init__(str(errors[0]))
        self.errors = tuple(errors)


class Mistakes:
    """Gathers the errors of parts that do not depend on each other, each in a `with` of its own."""

    def __init__(self) -> None:
        self.found: dict[str, DefinitionError] = {}
        """By what they say, so that nothing is told twice."""

    def __enter__(self) -> None:
        """Keep a DefinitionError of the block for later."""

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, DefinitionErrors):
            self.add(*error.errors)
        elif isinstance(error, DefinitionError):
            self.add(error)
        return isinstance(error, DefinitionError)

    def add(self, *errors: DefinitionError) -> None:
        """Keep errors for later."""
        for error in errors:
            self.found.setdefault(str(error), error)

    def tell(self) -> None:
        """Raise what was gathered: one DefinitionError, or all as DefinitionErrors."""
        errors = list(self.found.values())
        if len(errors) > 1:
            raise DefinitionErrors(errors)
        if errors:
            raise errors[0]


class RunError(MsgdropError):
    """A run could not be trained or evaluated."""

    exit_code = 1


class RecordError(MsgdropError):
    """The results store is damaged (2), cannot be created (73), fails (74), or is in use (75)."""

    def __init__(self, message: str, exit_code: int = 2) -> None:
        super().__init__(message)
        self.exit_code = exit_code


def code_of(fault: Exception, otherwise: int) -> int:
    """The exit code of a fault: 74 if the disk fails, whatever was tried, reading too."""
    return 74 if getattr(fault, "errno", None) in DISK_FAULTS else otherwise


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
