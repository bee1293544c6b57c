"""The rule of verdicts: a closed, group-sequential sign-flip test of a family of claims.

A look spends a share of alpha: of all patterns of signs as many may cross its boundary, in paths
that crossed none before, as the registration allows. A claim is decided once every set of claims
that contains it has crossed; the statistic of a set is its largest. So at most alpha of all studies
decide a claim of which nothing is true, whichever of the others are.

Assumed: where a claim is wrong, a seed's differences are as likely as their opposites, those of
several wrong claims together (common flips). Differences of arms that are paired and exchangeable
are.
"""

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any

from msgdrop_cli.analysis.sign_flips import TOLERANCE, Flipped, flipped, smallest_p
from msgdrop_cli.definition.spec import Registration


def deciding_looks(rule: Registration) -> list[int]:
    """The looks of one game, as numbers of seeds, at which a claim can get a verdict.

    They come after what had been seen, and their smallest p is not above the alpha there is.
    """
    left = [alpha - rule.gone for alpha in rule.alpha_spent]
    return [
        seeds
        for number, seeds in enumerate(rule.looks)
        if number >= rule.looks_gone and smallest_p(seeds, rule.sides) <= left[number] + TOLERANCE
    ]


def flips_of(differences: Sequence[Sequence[Sequence[float]]], rule: Registration) -> list[Flipped]:
    """The flips of a family at every look that it has reached.

    A look is of the whole family: each of its claims has these seeds, or is decided by an earlier
    one. Else the claims that come first would be judged at it twice, with the others and without.

    differences: [looks][claims][seeds], of seeds 1 to n as each look sees them, or of fewer.
    """
    flips: list[Flipped] = []
    before = 0
    for seeds, seen in zip(rule.looks, differences, strict=True):
        late = [claim for claim, each in enumerate(seen) if len(each) < seeds]
        if len(late) == len(seen):
            break
        if late and not (flips and _are_decided(late, flips, rule)):
            break
        flips.append(flipped(seen, seeds, before, sides=rule.sides))
        before = seeds
    return flips


def _are_decided(claims: Sequence[int], flips: Sequence[Flipped], rule: Registration) -> bool:
    when = decided(flips, rule)
    return all(when[claim] is not None for claim in claims)


def speaks_at(claim: int, flips: Sequence[Flipped], rule: Registration) -> int:
    """The look (0, 1, ...) at which a claim that is decided has crossed by itself.

    It is the sign there that is decided: sets with other claims may have crossed later.
    """
    return int(_crossed_at([claim], flips, rule))


def decided(flips: Sequence[Flipped], rule: Registration) -> list[int | None]:
    """For each claim of the family the look (0, 1, ...) that decides it, or None.

    Every set of claims is followed along the looks, the largest first: most claims that stay open
    stay so by the first set that holds them, and sets of such claims need not be followed.
    """
    if not flips:
        return []
    claims = len(flips[0].statistics)
    decides = [0.0] * claims
    for size in range(claims, 0, -1):
        for members in combinations(range(claims), size):
            if any(decides[claim] < math.inf for claim in members):
                crossed = _crossed_at([*members], flips, rule)
                for claim in members:
                    decides[claim] = max(decides[claim], crossed)
    return [None if look == math.inf else int(look) for look in decides]


def _crossed_at(members: list[int], flips: Sequence[Flipped], rule: Registration) -> float:
    """The first look at which the observed path of these claims' maximum crosses; inf for none."""
    crossed: Any = None
    for number, (statistics, earlier) in enumerate(flips):
        highest = statistics[members].max(axis=0)
        before = None if crossed is None else crossed[earlier]
        crossed = highest > _boundary(highest, before, number, rule) + TOLERANCE
        if before is not None:
            crossed |= before
        if crossed[0]:
            return number
    return math.inf


def _boundary(highest: Any, before: Any, number: int, rule: Registration) -> float:
    """What a path must exceed at a look, so that no more paths than allowed have crossed by then.

    highest: the statistic of each pattern; before: which of them have crossed already.
    """
    import numpy as np

    if number < rule.looks_gone:
        return math.inf  # whoever has looked already can register nothing about it
    used = rule.gone * len(highest) + (0 if before is None else int(np.count_nonzero(before)))
    allowed = math.floor(rule.alpha_spent[number] * len(highest) - used + TOLERANCE)
    candidates = highest if before is None else highest[~before]
    if allowed < 1 or allowed >= len(candidates):
        return math.inf
    place = len(candidates) - 1 - allowed
    return float(np.partition(candidates, place)[place])
