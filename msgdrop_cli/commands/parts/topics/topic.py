"""One thing that `explain` knows, whatever it is."""

from collections.abc import Iterator
from typing import NamedTuple


class Fact(NamedTuple):
    """One line of a topic."""

    name: str
    value: str
    meaning: str = ""


class Topic(NamedTuple):
    """One thing that can be explained."""

    kind: str
    names: tuple[str, ...]
    """What it is called."""
    where: str
    """Where it stands, or whose it is."""
    text: str
    facts: tuple[Fact, ...] = ()

    @property
    def calls(self) -> Iterator[str]:
        """What it may be called by: its names, and the last parts of those that are paths.

        The dot of `md-0.2` is none of a path.
        """
        for name in self.names:
            yield name
            if (last := name.rpartition(".")[2]).isidentifier():
                yield last


def spelled(name: str) -> str:
    """The same for `not run`, `not-run` and `Not_Run`: names differ in more than that."""
    return name.lower().replace("_", "-").replace(" ", "-")


def sentence(text: str) -> str:
    """The same with a great letter at its beginning and a full stop; `MADRL` stays."""
    return f"{text[:1].upper()}{text[1:]}."
