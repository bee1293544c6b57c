"""Estimates over seeds, with numbers that a pencil can check."""

import numpy as np
import pytest

from msgdrop_cli.analysis.statistics import (
    Interval,
    bootstrap_band,
    bootstrap_interval,
    difference_interval,
    interquartile_mean,
    iqm_interval,
    mean,
)


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


def test_one_seed_has_no_interval() -> None:
    """One value says nothing about its spread."""
    assert bootstrap_interval([5.0], np.random.default_rng(0)) is None


def test_two_seeds_span_the_interval() -> None:
    """A quarter of the resamples of two seeds is the lower one twice: the ends are the values."""
    assert bootstrap_interval([3.0, 1.0], np.random.default_rng(0)) == (1.0, 3.0)


def test_interval_of_three_seeds_against_all_27_resamples() -> None:
    """1/27 = 3.7% of the resamples of (0, 3, 9) are all 0 and as many all 9: more than 2.5%."""
    assert bootstrap_interval([0.0, 3.0, 9.0], np.random.default_rng(1)) == (0.0, 9.0)


def test_interval_of_four_seeds_against_all_256_resamples() -> None:
    """Of (0, 0, 0, 4) the mean 3 or more has 13/256 = 5.1%, 4 has 0.4%: the upper end is 3."""
    assert bootstrap_interval([0.0, 0.0, 0.0, 4.0], np.random.default_rng(2)) == (0.0, 3.0)


def test_same_generator_same_interval() -> None:
    """Nothing but the generator is drawn from."""
    values = [0.3, 1.7, 2.2, 5.0, 8.1]
    first, again, other = (
        bootstrap_interval(values, np.random.default_rng(seed)) for seed in (7, 7, 8)
    )
    assert first == again
    assert first != other


def test_bootstrap_covers_as_often_as_theory_says() -> None:
    """Of 20 normal seeds the percentile interval is 1.96 sd/sqrt(20) wide: t(19) covers 93%."""
    rng = np.random.default_rng(3)
    trials, hits = 400, 0
    for _ in range(trials):
        interval = bootstrap_interval(rng.normal(10.0, 2.0, 20).tolist(), rng, resamples=1_000)
        assert interval is not None
        hits += interval.low <= 10.0 <= interval.high
    assert 0.90 <= hits / trials <= 0.96


def test_few_seeds_are_covered_too_rarely() -> None:
    """The module's warning is true: of 4 normal seeds the interval covers about 80%, not 95%."""
    rng = np.random.default_rng(4)
    trials, hits = 400, 0
    for _ in range(trials):
        interval = bootstrap_interval(rng.normal(0.0, 1.0, 4).tolist(), rng, resamples=1_000)
        assert interval is not None
        hits += interval.low <= 0.0 <= interval.high
    assert 0.74 <= hits / trials <= 0.87


def test_difference_of_constant_groups() -> None:
    """Without spread the interval is the difference itself, first minus second."""
    interval = difference_interval([5.0, 5.0], [2.0, 2.0, 2.0], np.random.default_rng(0))
    assert interval == pytest.approx((3.0, 3.0))


def test_difference_needs_two_seeds_in_both_groups() -> None:
    """One seed in either group leaves its spread unknown."""
    rng = np.random.default_rng(0)
    assert difference_interval([1.0], [1.0, 2.0], rng) is None
    assert difference_interval([1.0, 2.0], [1.0], rng) is None


def test_band_resamples_whole_curves() -> None:
    """Every point uses the same draws: a curve shifted by 10 has a band shifted by 10."""
    curves = [[value, value + 10.0] for value in (0.0, 1.0, 5.0, 7.0)]
    left, right = bootstrap_band(curves, np.random.default_rng(5))
    assert right == pytest.approx(Interval(left.low + 10.0, left.high + 10.0))


def test_iqm_interval_is_the_resampled_iqm() -> None:
    """Of eight seeds, two far off: their pull on the mean's interval is not on the IQM's."""
    values = [1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 3.0, 100.0]
    of_iqm = iqm_interval(values, np.random.default_rng(0))
    of_mean = bootstrap_interval(values, np.random.default_rng(0))
    assert of_iqm is not None
    assert of_mean is not None
    assert 1.0 <= of_iqm.low <= 2.0 <= of_iqm.high < of_mean.high
    assert of_iqm == iqm_interval(values, np.random.default_rng(0))


def test_iqm_of_two_seeds_spans_both() -> None:
    """Nothing is cut from two values: the interval is lowest to highest, and one has none."""
    assert iqm_interval([1.0, 3.0], np.random.default_rng(0)) == (1.0, 3.0)
    assert iqm_interval([1.0], np.random.default_rng(0)) is None
