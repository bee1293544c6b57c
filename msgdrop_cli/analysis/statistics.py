"""Estimates over seeds: the seed is the unit; a run's episodes are one number before they get here.

Whatever is published is added up by `total`, in arrays by `cumsum` and `signed_sums`: the same bits
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
_EXACT_BITS, _SMALLEST_POWER = 53, -1074
"""Whole numbers up to 2 to the power of this are float64, and the smallest power of 2 that is."""
_COLUMNS = 1_024
"""Of signs that are float64 at a time: those of hundreds of seeds fit the cache."""


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


def signed_sums(numbers: Any, signs: Any) -> Any:
    """The matrix product of numbers and of -1, 0 and 1: exact, so in any order the same bits.

    numbers: [rows, terms], rounded to 2^-42 of the largest of their row and finer for up to 1,000
    terms: to a grid so coarse that a float64 holds every sum of some of them, and `@` may add as
    the processor likes. signs: [terms, columns]; returns float64 [rows, columns].
    """
    import numpy as np

    rows, terms = numbers.shape
    largest = np.frexp(np.maximum.reduce(np.abs(numbers), axis=1))[1]  # below 2 to the power of it
    power = np.maximum(largest + terms.bit_length() - _EXACT_BITS, _SMALLEST_POWER)
    grain = np.ldexp(1.0, power)[:, None]
    whole = np.rint(numbers / grain)
    found = np.empty((rows, signs.shape[1]))
    for start in range(0, signs.shape[1], _COLUMNS):
        some = slice(start, start + _COLUMNS)
        found[:, some] = whole @ signs[:, some].astype(np.float64)
    return found * grain


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
