"""Estimates over seeds, with numbers that a pencil can check."""

import numpy as np
import pytest

from msgdrop_cli.analysis.intervals import mean_interval
from msgdrop_cli.analysis.statistics import interquartile_mean, iqm_interval, mean


def test_mean() -> None:
    """The mean is the sum over the number."""
    assert mean([1.0, 2.0, 6.0]) == 3.0


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([7.0], 7.0),
        ([3.0, 0.0, 30.0], 11.0),  # floor(3/4) = 0: nothing is cut
        ([100.0, 2.0, -50.0, 4.0], 3.0),  # one cut on each side: 2 and 4 stay
        ([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 99.0], 3.0),  # floor(7/4) = 1
        ([9.0, 9.0, 1.0, 2.0, 3.0, 6.0, -9.0, -9.0], 3.0),  # two cut on each side
    ],
)
def test_interquartile_mean(values: list[float], expected: float) -> None:
    """A quarter of the seeds is cut at each end, whatever the order."""
    assert interquartile_mean(values) == expected


def test_no_seed_has_no_estimate() -> None:
    """An empty arm is a mistake of the caller, not a number."""
    with pytest.raises(ValueError, match="at least one seed"):
        mean([])


def test_few_seeds_are_covered_too_rarely_by_resampling() -> None:
    """The module's warning is true: of 6 normal seeds it covers about 86%, the sign-flips 97%."""
    rng = np.random.default_rng(4)
    trials, resampled, flipped = 400, 0, 0
    for _ in range(trials):
        values = rng.normal(0.0, 1.0, 6)
        low, high = np.quantile(rng.choice(values, (1_000, 6)).mean(axis=1), [0.025, 0.975])
        interval = mean_interval(values.tolist())
        assert interval is not None
        resampled += low <= 0.0 <= high
        flipped += interval.low <= 0.0 <= interval.high
    assert 0.80 <= resampled / trials <= 0.91
    assert flipped / trials >= 0.94


def test_iqm_interval_is_the_resampled_iqm() -> None:
    """Of ten seeds, one far off: its pull on the mean's interval is not on the IQM's."""
    values = [1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 3.0, 100.0]
    of_iqm = iqm_interval(values, np.random.default_rng(0))
    of_mean = mean_interval(values)
    assert of_iqm is not None
    assert of_mean is not None
    assert 1.0 <= of_iqm.low <= 2.0 <= of_iqm.high < of_mean.high
    assert of_iqm == iqm_interval(values, np.random.default_rng(0))


def test_fewer_than_ten_seeds_are_not_resampled() -> None:
    """Their interval would be too narrow to be shown."""
    assert iqm_interval([1.0] * 9, np.random.default_rng(0)) is None
    assert iqm_interval([1.0] * 10, np.random.default_rng(0)) == (1.0, 1.0)
