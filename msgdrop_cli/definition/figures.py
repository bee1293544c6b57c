"""The paper's figures that show results: each is a part of a question that is shipped."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from msgdrop_cli.definition.shipped import FIGURES, shipped_file
from msgdrop_cli.definition.spec import Definition
from msgdrop_cli.definition.strict import Where, convert, read_toml


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """What one figure of the paper shows."""

    shows: str
    question: str
    """The question that it belongs to."""
    environments: tuple[str, ...]
    """The question's, as far as the figure shows them."""
    measures: tuple[Literal["evaluation", "learning"], ...] = ("evaluation", "learning")
    """What it shows of the runs: the claims of nothing else are judged."""


def all_figures() -> Mapping[str, Figure]:
    """Every figure by the name that it is asked by, e.g. `figure-3a`."""
    where = Where(FIGURES)
    found: Mapping[str, Figure] = convert(
        read_toml(shipped_file(FIGURES), where), Mapping[str, Figure], where
    )
    return {f"figure-{number}": figure for number, figure in found.items()}


def part_of(question: Definition, name: str, figure: Figure) -> Definition:
    """The question as the figure asks it: all of its variants, in each of its profiles.

    The runs are the question's, whoever trains them first.
    """
    whole = {
        key: replace(profile, environments=None, variants=None)
        for key, profile in question.profiles.items()
    }
    return replace(
        question,
        name=name,
        title=f"{name.replace('-', ' ').capitalize()}: {figure.shows}",
        environments=figure.environments,
        profiles=whole,
        claims=tuple(
            claim
            for claim in question.claims
            if claim.environment in figure.environments and claim.measure in figure.measures
        ),
    )
