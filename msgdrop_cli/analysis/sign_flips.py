"""Paired differences and nothing else: if no arm is better, the sign of each seed's is a fair coin.

All patterns of signs are enumerated up to ENUMERATED seeds, which makes every number exact; beyond,
a sample of fixed seed stands for them. No normality is assumed and no mean is resampled.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from msgdrop_cli.analysis.statistics import signed_sums

ENUMERATED = 20
"""Seeds up to which all 2^n patterns are gone through."""
SAMPLE = 2**17
"""Patterns drawn where there are more seeds, the observed one among them."""
DRAWN_WITH = 20190127
"""Seed of the sample (ours)."""
TOLERANCE = 1e-9
"""Statistics as close as this are one value: sums in another order differ in their last bits."""


class Flipped(NamedTuple):
    """The statistics of some claims under all patterns of signs, or a sample of them."""

    statistics: Any
    """float64 [claims, patterns], the observed one first; -inf for a claim with too few seeds."""
    earlier: Any
    """int64 [patterns]: where each, cut to the seeds of the look before, stands there."""


def flipped(
    differences: Sequence[Sequence[float]], seeds: int, before: int, *, sides: int
) -> Flipped:
    """What the first `seeds` differences of each claim might have been; the flips are common.

    The statistic is the sum over the root of the sum of squares, which no flip changes: it orders
    patterns as the mean does and compares claims as t does; |sum| with two sides. before: seeds of
    the look before, 0 for none. With two sides the first sign stays, which halves the patterns.
    """
    import numpy as np

    enough = np.array([len(each) >= seeds for each in differences])
    table = np.array([each[:seeds] for each in differences if len(each) >= seeds], dtype=np.float64)
    if seeds <= ENUMERATED:
        sums, places = _all_sums(table, sides), np.arange(2 ** (seeds - (sides == 2)))
    else:
        signs = _sampled_signs(seeds, sides)
        sums, places = signed_sums(table, signs.T), np.arange(SAMPLE)
    size = np.sqrt(np.square(table).cumsum(axis=1)[:, -1:])
    found = np.divide(sums, size, out=np.zeros_like(sums), where=size > 0.0)
    statistics = np.full((len(enough), sums.shape[1]), -np.inf)
    statistics[enough] = np.abs(found) if sides == 2 else found
    if seeds <= ENUMERATED:
        places %= 2 ** (before - (sides == 2)) if before else 1
    elif before <= ENUMERATED:
        flips = signs[:, (sides == 2) : before] < 0.0
        places = np.bitwise_or.reduce(flips << np.arange(flips.shape[1]), axis=1)
    return Flipped(statistics, places)


def p_value(statistics: Any) -> float:
    """The share of patterns that reach the observed one, the first; statistics: [patterns]."""
    return _share(statistics >= statistics[0] - TOLERANCE)


def step_down(statistics: Any) -> list[float]:
    """P of each claim in its family: the step-down maximum (Westfall and Young) over common flips.

    statistics: [claims, patterns]; -inf rows take no part and get 1.0.
    """
    import numpy as np

    ranks = sorted(range(len(statistics)), key=lambda claim: -statistics[claim][0])
    found, reached = [1.0] * len(ranks), 0.0
    for place, claim in enumerate(ranks):
        if not math.isfinite(statistics[claim][0]):
            break
        highest = np.maximum.reduce(statistics[ranks[place:]])
        reached = max(reached, _share(highest >= statistics[claim][0] - TOLERANCE))
        found[claim] = reached
    return found


def holm(values: Sequence[float]) -> list[float]:
    """The same from p-values alone, whatever their dependence."""
    found, reached = [1.0] * len(values), 0.0
    for place, claim in enumerate(sorted(range(len(values)), key=lambda each: values[each])):
        reached = max(reached, min(1.0, (len(values) - place) * values[claim]))
        found[claim] = reached
    return found


def smallest_p(seeds: int, sides: int) -> float:
    """What p is if all seeds agree; nothing smaller can be found."""
    return sides / 2.0**seeds if seeds <= ENUMERATED else 1.0 / SAMPLE


def sampling_error(p: float, seeds: int) -> float:
    """Monte-Carlo standard error of a p; 0 where all patterns are enumerated."""
    return 0.0 if seeds <= ENUMERATED else math.sqrt(p * (1.0 - p) / SAMPLE)


def _share(reached: Any) -> float:
    """Of the patterns, how many are true."""
    import numpy as np

    return int(np.count_nonzero(reached)) / len(reached)


def _all_sums(table: Any, sides: int) -> Any:
    """Sums under every pattern; bit i of its number (two sides: i - 1) is whether seed i flips.

    table: [claims, seeds]; returns [claims, patterns].
    """
    import numpy as np

    sums = table[:, :1] if sides == 2 else np.zeros((len(table), 1))
    for column in table.T[sides == 2 :, :, None]:
        sums = np.concatenate([sums + column, sums - column], axis=1)
    return sums


def _sampled_signs(seeds: int, sides: int) -> Any:
    """Drawn patterns [SAMPLE, seeds]; more seeds only add columns, so that paths go on."""
    import numpy as np

    rng = np.random.default_rng(DRAWN_WITH)
    signs = np.stack([rng.choice([-1.0, 1.0], SAMPLE) for _ in range(seeds)], axis=1)
    signs[0] = 1.0
    return signs * signs[:, :1] if sides == 2 else signs
