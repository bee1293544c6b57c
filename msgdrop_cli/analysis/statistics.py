"""Estimates over seeds: the seed is the unit; a run's episodes are one number before they get here.

Whatever is published is added up by `total`, in arrays by `cumsum` and `products`: the same bits
under every Python, numpy and processor. The builtin `sum` of floats compensates from Python 3.12
on; `.sum()`, `.mean()` and `@` of arrays may add in any order (test_adding forbids all of these).

Every random draw comes from a generator that the caller passes in. Percentile bootstrap intervals
of few seeds are too narrow (test_statistics measures it), so there is none below ten; intervals of
means are no bootstrap at all (`intervals`).
"""

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from numpy.random import Generator

RESAMPLES = 10_000
LEVEL = 0.95
FEWEST_RESAMPLED = 10
"""Seeds; fewer are not resampled."""


class Interval(NamedTuple):
    """Lower and upper end, in the unit of the values."""

    low: float
    high: float


def total(values: Iterable[float]) -> float:
    """The sum, exact and then rounded once, so that no order of adding shows in it.

    Raises ValueError where that is beyond every float, on the way to it included.
    """
    try:
        return math.fsum(values)
    except OverflowError as error:
        raise ValueError("a sum is beyond every float") from error


def products(left: Any, right: Any) -> Any:
    """The matrix product of two arrays, float64: each sum in the order of its terms.

    left: [rows, terms]; right: [terms, columns]; returns [rows, columns].
    """
    import numpy as np

    found = np.zeros((left.shape[0], right.shape[1]))
    for column, row in zip(left.T, right, strict=True):
        found += column[:, None] * row
    return found


def mean(values: Sequence[float]) -> float:
    """The arithmetic mean; raises ValueError when there is no value."""
    _check_some(values)
    return total(values) / len(values)


def interquartile_mean(values: Sequence[float]) -> float:
    """The mean without the lowest and highest floor(n/4) values (rliable's IQM, trim_mean 0.25).

    Raises ValueError when there is no value; up to 3 values nothing is cut.
    """
    _check_some(values)
    cut = len(values) // 4
    return mean(sorted(values)[cut : len(values) - cut])


def root_mean_square(values: Sequence[float | None]) -> float | None:
    """Of errors that add up by their squares; None where one is not known."""
    known = [value for value in values if value is not None]
    if not known or len(known) < len(values):
        return None
    return math.sqrt(mean([value * value for value in known]))


def iqm_interval(
    values: Sequence[float], rng: "Generator", *, resamples: int = RESAMPLES
) -> Interval | None:
    """95% percentile bootstrap interval of the interquartile mean; None below FEWEST_RESAMPLED.

    Raises ValueError when there is no value.
    """
    import numpy as np

    _check_some(values)
    n = len(values)
    if n < FEWEST_RESAMPLED:
        return None
    drawn = np.sort(rng.choice(np.asarray(values, dtype=np.float64), (resamples, n)), axis=1)
    cut = n // 4
    means = drawn[:, cut : n - cut].cumsum(axis=1)[:, -1] / (n - 2 * cut)
    low, high = np.quantile(means, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
    return Interval(float(low), float(high))


def _check_some(values: Sequence[Any]) -> None:
    if not values:
        raise ValueError("an estimate needs at least one seed")
