"""What a row of the fault table is."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random


class Broken(Exception):
    """What a trial found that must not be."""


class NotHere(Exception):
    """Why a trial cannot be made on this machine."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One disturbance: all that is random in it follows from the row's name and the number."""

    number: int
    folder: Path
    """Empty, and of this trial alone."""
    bench: Path
    """What all trials share, and none changes: see `study.make_bench`."""
    rng: Random


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One fault, how often it is tried, and what must happen."""

    name: str
    promise: str
    trials: int
    """In full; FAULTS=0.1 makes a tenth of them."""
    share: int
    """How many of them the test suite makes."""
    trial: Callable[[Trial], float | None]
    """Raises Broken; returns what took how long (s), where the promise names a time."""
    each: int = 1
    """Cases in one trial, where they are cheap."""
    at_a_time: int = 2
    """Trials; more where they wait most of their time."""


def expect(fact: object, words: str) -> None:
    """Raises Broken with these words unless the fact holds."""
    if not fact:
        raise Broken(words)
