"""What would probably decide a claim that is open: at how many seeds.

A forecast from what was seen: it decides nothing, so it may use the normal distribution.
"""

import math
from statistics import NormalDist, stdev
from typing import NamedTuple

from msgdrop_cli.analysis.pairs import Pair
from msgdrop_cli.analysis.sequential import deciding_looks
from msgdrop_cli.analysis.statistics import mean
from msgdrop_cli.definition.spec import Registration

_FEWEST = 3
"""Pairs, for two say nearly nothing of a spread."""
_IN_REACH = 5
"""Times the seeds of the last look: what would take more is not forecast."""


TOO_FEW = f"below {_FEWEST} seeds there is no forecast"
"""What is said of a claim that nobody has run, too."""


class Prospect(NamedTuple):
    """When an open claim would be decided if what was seen goes on."""

    seeds: int
    """A registered look, or more seeds than the last one has."""
    registered: bool


def prospect(pair: Pair, look: int, rule: Registration, family: int) -> Prospect | None:
    """The first look from number `look` on that more likely than not decides.

    family: claims that are judged together; each is given its part of what a look may spend. None
    where nothing is known of the spread, or where no number of seeds in reach would do.
    """
    values = [*pair.differences.values()]
    spread = stdev(values) if len(values) >= _FEWEST else 0.0
    if not spread:
        return None
    effect = abs(mean(values)) / spread
    able, spent = deciding_looks(rule), rule.gone
    for number, (seeds, alpha) in enumerate(zip(rule.looks, rule.alpha_spent, strict=True)):
        if seeds not in able:
            continue  # what it cannot use is kept for the next look, if it had not been seen
        share, spent = alpha - spent, alpha
        if number >= look and effect * math.sqrt(seeds) >= _far(share / rule.sides / family):
            return Prospect(seeds, True)
    last = rule.looks[-1]
    seeds = math.ceil((_far(rule.alpha / rule.sides / family) / max(effect, 1e-9)) ** 2)
    if seeds > _IN_REACH * last:
        return None
    return Prospect(max(seeds, last + 1), False)


def no_forecast(pair: Pair, rule: Registration) -> str:
    """Why `prospect` has nothing to say of an open claim."""
    values = [*pair.differences.values()]
    if len(values) < _FEWEST:
        return TOO_FEW
    if not stdev(values):
        return "all seeds differ alike, so there is no forecast"
    return f"as it stands {_IN_REACH * rule.looks[-1]} seeds would probably not decide"


def _far(share: float) -> float:
    """How many standard errors a difference must have to be as rare on one side."""
    return NormalDist().inv_cdf(1.0 - share) if share > 0.0 else math.inf
