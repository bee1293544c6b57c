"""Intervals over seeds: the means that a sign-flip test of the seeds does not reject.

Below six seeds no such test reaches 5%: there the lowest and the highest seed stand for the
interval, and whoever shows it says so. Nothing is resampled.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from msgdrop_cli.analysis.sign_flips import DRAWN_WITH, ENUMERATED, SAMPLE, TOLERANCE
from msgdrop_cli.analysis.statistics import Interval, signed_sums

ALPHA = 0.05
FEWEST = 6
"""Seeds from which on an interval covers 95%: 2 / 2^6 is below 5%, 2 / 2^5 is not."""
_MOST_OF_CURVES = 2**12
"""Subsets of whole curves; more of them are drawn from."""
_AT_ONCE = 1_024
"""Subsets that are drawn together."""


def mean_interval(values: Sequence[float]) -> Interval | None:
    """95% interval of the mean over seeds, lowest to highest below FEWEST; None for one seed.

    Raises ValueError when there is no value.
    """
    return _mean_interval(tuple(values))


@lru_cache(maxsize=256)  # figures, tables and claims ask for the same ones
def _mean_interval(values: tuple[float, ...]) -> Interval | None:
    band = mean_band([[value] for value in values])
    return band[0] if band else None


def mean_band(curves: Sequence[Sequence[float]]) -> list[Interval] | None:
    """The same of the mean curve, at each point for itself; curves: [seeds][points]."""
    if not curves:
        raise ValueError("an interval needs at least one seed")
    if len(curves) == 1:
        return None
    if len(curves) < FEWEST:
        return [Interval(min(point), max(point)) for point in zip(*curves, strict=True)]
    return flip_band(curves, ALPHA)


def flip_interval(values: Sequence[float], alpha: float) -> Interval | None:
    """The means that a two-sided sign-flip test of the values does not reject at `alpha`.

    None where it can reject none.
    """
    band = flip_band([[value] for value in values], alpha)
    return band[0] if band else None


def flip_band(curves: Sequence[Sequence[float]], alpha: float) -> list[Interval] | None:
    """The interval of `flip_interval` at each point of curves [seeds][points]; None likewise.

    Both ends are means of some of the seeds: the test rejects a mean if too few of the 2^n - 1
    subsets have a smaller one, or a larger one (Hartigan's typical values), so the ends cut off
    exactly that share of the subsets.
    """
    import numpy as np

    means = _subset_means(np.asarray(curves, dtype=np.float64).T)
    subsets = means.shape[1]
    cut = math.floor(alpha / 2.0 * (subsets + 1) + TOLERANCE)
    if cut < 1:
        return None
    # One place at a time: numpy's fast way of finding it knows no two.
    lows, highs = (
        np.partition(means, place, axis=1)[:, place] for place in (cut - 1, subsets - cut)
    )
    return [Interval(*ends) for ends in zip(lows.tolist(), highs.tolist(), strict=True)]


def _subset_means(table: Any) -> Any:
    """The mean of every subset of the columns but the empty one, or of a sample of them.

    table: [points, seeds]; returns [points, subsets].
    """
    import numpy as np

    points, seeds = table.shape
    if 2**seeds <= (2**ENUMERATED if points == 1 else _MOST_OF_CURVES):
        sums, counts = np.zeros((points, 1)), np.zeros(1)
        for column in table.T[:, :, None]:
            sums = np.concatenate([sums, sums + column], axis=1)
            counts = np.concatenate([counts, counts + 1.0])
        return sums[:, 1:] / counts[1:]
    chosen, counts = _drawn(seeds, SAMPLE if points == 1 else _MOST_OF_CURVES)
    return signed_sums(table, chosen) / counts


@lru_cache(maxsize=4)  # drawing takes longer than adding; some arms have a seed more
def _drawn(seeds: int, subsets: int) -> tuple[Any, Any]:
    """Which seeds are in each drawn subset, a byte each [seeds, subsets - 1], and how many."""
    import numpy as np

    rng = np.random.default_rng(DRAWN_WITH)
    chosen = np.empty((subsets - 1, seeds), dtype=np.int8)
    for some in np.array_split(chosen, subsets // _AT_ONCE):  # what is drawn has 8 bytes each
        some[:] = rng.integers(0, 2, some.shape)
    chosen[~chosen.any(axis=1)] = 1  # hardly ever: the whole set instead of the empty one
    return chosen.T, np.count_nonzero(chosen, axis=1)
