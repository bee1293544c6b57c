"""Estimates over seeds: the seed is the unit; a run's episodes are one number before they get here.

Every random draw comes from a generator that the caller passes in. Percentile bootstrap intervals
of few seeds are too narrow (test_statistics measures it): with 2 seeds they are just min to max.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from numpy.random import Generator

RESAMPLES = 10_000
LEVEL = 0.95


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


def bootstrap_interval(
    values: Sequence[float], rng: "Generator", *, resamples: int = RESAMPLES
) -> Interval | None:
    """95% percentile bootstrap interval of the mean; None for one value, which has no spread.

    Raises ValueError when there is no value.
    """
    _check_some(values)
    if len(values) == 1:
        return None
    return _percentiles(_resampled_means([[value] for value in values], rng, resamples))[0]


def iqm_interval(
    values: Sequence[float], rng: "Generator", *, resamples: int = RESAMPLES
) -> Interval | None:
    """95% percentile bootstrap interval of the interquartile mean; None for one value."""
    import numpy as np

    _check_some(values)
    n = len(values)
    if n == 1:
        return None
    drawn = np.sort(rng.choice(np.asarray(values, dtype=np.float64), (resamples, n)), axis=1)
    cut = n // 4
    return _percentiles(drawn[:, cut : n - cut].mean(1, keepdims=True))[0]


def bootstrap_band(
    curves: Sequence[Sequence[float]], rng: "Generator", *, resamples: int = 2_000
) -> list[Interval]:
    """95% bootstrap interval of the mean curve at each point; whole curves are resampled.

    curves: [seeds][points], one list per seed, equally long. Returns [points].
    """
    _check_some(curves)
    return _percentiles(_resampled_means(curves, rng, resamples))


def difference_interval(
    first: Sequence[float], second: Sequence[float], rng: "Generator", *, resamples: int = RESAMPLES
) -> Interval | None:
    """95% bootstrap interval of mean(first) - mean(second), two unpaired groups of seeds.

    None when a group has one value. For paired seeds use `bootstrap_interval` of the differences.
    """
    _check_some(first)
    _check_some(second)
    if min(len(first), len(second)) == 1:
        return None
    drawn = [_resampled_means([[v] for v in group], rng, resamples) for group in (first, second)]
    return _percentiles(drawn[0] - drawn[1])[0]


def _resampled_means(values: Sequence[Sequence[float]], rng: "Generator", resamples: int) -> Any:
    """Means of resampled seeds. values: [seeds][points]; returns float64 [resamples, points]."""
    import numpy as np

    n = len(values)
    # How often each seed is drawn says all about a resample; one product then serves all points.
    counts = rng.multinomial(n, np.full(n, 1.0 / n), size=resamples)
    return counts @ np.asarray(values, dtype=np.float64) / n


def _percentiles(means: Any) -> list[Interval]:
    """The central 95% of each column. means: [resamples, points]; returns [points]."""
    import numpy as np

    low, high = np.quantile(means, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0], axis=0)
    return [Interval(float(a), float(b)) for a, b in zip(low, high, strict=True)]


def _check_some(values: Sequence[Any]) -> None:
    if not values:
        raise ValueError("an estimate needs at least one seed")
