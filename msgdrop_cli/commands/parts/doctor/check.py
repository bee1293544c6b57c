"""What a check is, and what it finds."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

State = Literal["fine", "note", "mend"]
"""`note`: it works, but slower or with less than there could be; `mend`: something fails."""


class Found(NamedTuple):
    """What a check found, in one line."""

    state: State
    words: str
    fix: str = ""
    """What to do, in one line; empty if all is fine."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One thing that is looked at; `look` is given the results folder, which need not exist."""

    name: str
    look: Callable[[Path], Found]

    def __call__(self, results: Path) -> Found:
        """What it finds; a check that fails itself has found something, too."""
        try:
            return self.look(results)
        except Exception as error:  # whatever is broken here is what the user wants to hear of
            return mend(f"{type(error).__name__}: {error}", "mend what this error names")


def fine(words: str) -> Found:
    """All is as it should be."""
    return Found("fine", words)


def note(words: str, fix: str) -> Found:
    """It works, but something could be better."""
    return Found("note", words, fix)


def mend(words: str, fix: str) -> Found:
    """Something does not work."""
    return Found("mend", words, fix)


def existing(path: Path) -> Path:
    """The folder itself, or the nearest one above it that there is."""
    path = path.absolute()
    return next(each for each in (path, *path.parents) if each.is_dir())
