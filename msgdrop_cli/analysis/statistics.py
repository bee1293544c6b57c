"""Estimates over seeds: the seed is the unit; a run's episodes are one number before they get here.

Every random draw comes from a generator that the caller passes in. Percentile bootstrap intervals
of few seeds are too narrow (test_statistics measures it), so there is none below ten; intervals of
means are no bootstrap at all (`intervals`).
"""

import math
from collections.abc import Sequence
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


def mean(values: Sequence[float]) -> float:
    """The arithmetic mean; raises ValueError when there is no value."""
    _check_some(values)
    return math.fsum(values) / len(values)


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
    means = drawn[:, cut : n - cut].mean(1)
    low, high = np.quantile(means, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
    return Interval(float(low), float(high))


def _check_some(values: Sequence[Any]) -> None:
    if not values:
        raise ValueError("an estimate needs at least one seed")
