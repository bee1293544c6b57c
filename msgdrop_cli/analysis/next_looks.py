"""How far to train, so that open claims are looked at again: to the next look and no further."""

from collections.abc import Sequence
from typing import NamedTuple

from msgdrop_cli.analysis.sequential import deciding_looks
from msgdrop_cli.analysis.verdict import Verdict
from msgdrop_cli.definition.spec import Registration

_OPEN = ("undecided", "not run")


class NextLook(NamedTuple):
    """The arms of one game that are due at one look."""

    environment: str
    look: int
    """Its number: 1, 2, ..."""
    seeds: int
    """Seeds 1 to n."""
    variants: tuple[str, ...]
    """In alphabetical order."""
    claims: int
    """Of the open ones, those that wait for this look."""


def next_looks(verdicts: Sequence[Verdict], rule: Registration) -> list[NextLook]:
    """For the arms of every open claim the first look not reached yet that can decide anything.

    An arm of several open claims is due at the last of their looks. What is decided needs no arm,
    and an open claim without a look that is left none either. What is level has rejected nothing:
    it goes on with its family, whose sets of claims it is in.
    """
    waiting: dict[tuple[str, int], int] = {}
    families: dict[tuple[str, str], int] = {}
    for verdict in verdicts:
        claim, reached = verdict.claim, verdict.evidence.seeds if verdict.evidence else 0
        able = [n for n in deciding_looks(rule.in_game(claim.environment)) if n > reached]
        if verdict.verdict in _OPEN and able:
            look = rule.looks.index(able[0]) + 1
            waiting[claim.environment, look] = waiting.get((claim.environment, look), 0) + 1
            families[claim.family] = max(look, families.get(claim.family, 0))
    due: dict[tuple[str, str], int] = {}
    for claim in (each.claim for each in verdicts if each.verdict in (*_OPEN, "level")):
        for variant in (claim.better, claim.worse):
            arm = (claim.environment, variant)
            due[arm] = max(families.get(claim.family, 0), due.get(arm, 0))
    arms: dict[tuple[str, int], list[str]] = {}
    for (environment, variant), look in sorted(due.items()):
        if look:
            arms.setdefault((environment, look), []).append(variant)
    return [
        NextLook(
            environment=environment,
            look=look,
            seeds=rule.looks[look - 1],
            variants=tuple(variants),
            claims=waiting[environment, look],
        )
        for (environment, look), variants in sorted(arms.items())
    ]
