"""Sign-flip tests against what they are by definition: all patterns of signs, and scipy."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import permutation_test

from msgdrop_cli.analysis.intervals import _drawn, flip_band, flip_interval, mean_interval
from msgdrop_cli.analysis.sign_flips import (
    DRAWN_WITH,
    ENUMERATED,
    SAMPLE,
    flipped,
    holm,
    p_value,
    sampling_error,
    smallest_p,
    step_down,
)
from msgdrop_cli.analysis.statistics import Interval


def draws(seed: int, seeds: int, claims: int = 1) -> list[list[float]]:
    """Rounded, so that patterns tie: [claims][seeds]."""
    values = np.random.default_rng(seed).normal(0.5, 1.0, (claims, seeds)).round(1)
    return [[float(value) for value in row] for row in values]


def p_of(differences: list[float], *, sides: int = 2) -> float:
    """The p of one claim at its last seed."""
    return p_value(flipped([differences], len(differences), 0, sides=sides).statistics[0])


@pytest.mark.parametrize("sides", [1, 2])
@pytest.mark.parametrize("seeds", [1, 2, 5, 8])
def test_p_is_the_share_of_all_patterns(seeds: int, sides: int) -> None:
    """Brute force: every assignment of signs whose sum is as far out as the observed one."""
    for trial in range(20):
        (values,) = draws(trial, seeds)
        sums = [sum(s * v for s, v in zip(p, values, strict=True)) for p in signs(seeds)]
        ranks = [abs(total) if sides == 2 else total for total in sums]
        assert p_of(values, sides=sides) == pytest.approx(
            np.mean([rank >= ranks[0] - 1e-9 for rank in ranks])
        )


def signs(seeds: int) -> list[tuple[float, ...]]:
    """All patterns, the observed one first."""
    return list(product((1.0, -1.0), repeat=seeds))


@pytest.mark.parametrize("seeds", [6, 10, 14])
@pytest.mark.parametrize(("sides", "alternative"), [(1, "greater"), (2, "two-sided")])
def test_p_is_scipys(seeds: int, sides: int, alternative: str) -> None:
    """An exact paired permutation test of the mean (scipy doubles the smaller tail: the same)."""
    (values,) = draws(seeds, seeds)
    found = permutation_test(
        (values,),
        np.mean,
        permutation_type="samples",
        alternative=alternative,
        n_resamples=np.inf,
        vectorized=True,
    )
    assert p_of(values, sides=sides) == pytest.approx(found.pvalue)


def test_smallest_p_is_reached_when_all_seeds_agree() -> None:
    """Two of 64 patterns with six seeds; without a difference every pattern is the observed one."""
    assert p_of([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) == smallest_p(6, 2) == 0.03125
    assert p_of([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], sides=1) == smallest_p(6, 1) == 0.015625
    assert p_of([0.0] * 6) == 1.0


def test_beyond_what_is_enumerated_a_sample_stands_for_all() -> None:
    """The same numbers each time, within three standard errors of scipy's normal limit."""
    (values,) = draws(1, ENUMERATED + 4)
    p = p_of([value - 0.2 for value in values])
    assert p == p_of([value - 0.2 for value in values])
    (exact,) = draws(1, ENUMERATED + 4)
    rng = np.random.default_rng(5)
    other = permutation_test(
        ([value - 0.2 for value in exact],),
        np.mean,
        permutation_type="samples",
        n_resamples=SAMPLE,
        vectorized=True,
        batch=SAMPLE // 8,
        rng=rng,
    ).pvalue
    error = sampling_error(p, ENUMERATED + 4)
    assert 0.0 < error < 0.002
    assert abs(p - other) < 4.0 * error
    assert sampling_error(p, ENUMERATED) == 0.0


@pytest.mark.parametrize("sides", [1, 2])
@pytest.mark.parametrize(("before", "seeds"), [(3, 5), (4, 21), (21, 22)])
def test_paths_lead_back_to_the_same_signs(before: int, seeds: int, sides: int) -> None:
    """Seeds without a difference change no statistic, so every pattern keeps the one it had."""
    (values,) = draws(2, before)
    first = flipped([values], before, 0, sides=sides)
    last = flipped([values + [0.0] * (seeds - before)], seeds, before, sides=sides)
    assert last.statistics[0] == pytest.approx(first.statistics[0][last.earlier])
    assert len(np.unique(last.statistics[0].round(6))) > 1


def test_step_down_by_brute_force() -> None:
    """Each claim against the maximum of those that are not ahead of it, signs in common."""
    family = draws(3, 6, claims=3)
    table = np.asarray(family)
    size = np.sqrt(np.square(table).sum(axis=1))
    ranks = np.asarray([np.abs(table @ np.asarray(p)) / size for p in signs(6)])
    order = sorted(range(3), key=lambda claim: -ranks[0][claim])
    reached, expected = 0.0, [0.0] * 3
    for place, claim in enumerate(order):
        highest = ranks[:, order[place:]].max(axis=1)
        reached = max(reached, float(np.mean(highest >= ranks[0][claim] - 1e-9)))
        expected[claim] = reached
    found = step_down(flipped(family, 6, 0, sides=2).statistics)
    assert found == pytest.approx(expected)


def test_claims_that_move_together_cost_nothing() -> None:
    """The same claim three times is one claim, which Holm cannot know."""
    values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    family = flipped([values] * 3, 6, 0, sides=2).statistics
    assert step_down(family) == [p_value(family[0])] * 3
    assert holm([p_value(family[0])] * 3) == [3.0 * p_value(family[0])] * 3


def test_a_claim_without_the_seeds_takes_no_part() -> None:
    """Neither in the family of a look nor in its own."""
    one, other = draws(5, 6, claims=2)
    statistics = flipped([one, other[:5]], 6, 0, sides=2).statistics
    assert step_down(statistics) == [p_of(one), 1.0]


def test_holm_by_hand() -> None:
    """Smallest times 3, next times 2, last times 1, never falling and at most 1."""
    assert holm([0.04, 0.01, 0.03]) == pytest.approx([0.06, 0.03, 0.06])
    assert holm([0.9, 0.8]) == [1.0, 1.0]


@pytest.mark.parametrize(("seeds", "alpha"), [(6, 0.05), (7, 0.05), (8, 0.1), (9, 0.01)])
def test_an_interval_is_what_the_test_does_not_reject(seeds: int, alpha: float) -> None:
    """Just inside both ends p is above alpha, just outside it is not."""
    for trial in range(10):
        (values,) = draws(trial, seeds)
        interval = flip_interval(values, alpha)
        assert interval is not None
        for end, outwards in ((interval.low, -1.0), (interval.high, 1.0)):
            inside, outside = (end - step * outwards * 1e-6 for step in (1.0, -1.0))
            assert p_of([value - outside for value in values]) <= alpha
            assert p_of([value - inside for value in values]) > alpha


def test_six_seeds_reach_from_the_lowest_to_the_highest() -> None:
    """One pattern of 64 is cut off at either end; with five no test reaches 5%."""
    values = [3.0, 1.0, 4.0, 1.5, 9.0, 2.6]
    assert flip_interval(values, 0.05) == (1.0, 9.0)
    assert flip_interval(values[:5], 0.05) is None


def test_below_six_seeds_the_seeds_themselves_are_shown() -> None:
    """Lowest to highest, which covers less than 95%; one seed has no spread."""
    assert mean_interval([3.0, 1.0]) == (1.0, 3.0)
    assert mean_interval([3.0, 1.0, 4.0, 1.5, 9.0]) == (1.0, 9.0)
    assert mean_interval([5.0]) is None
    with pytest.raises(ValueError, match="at least one seed"):
        mean_interval([])


def test_intervals_cover_what_they_say() -> None:
    """Of 7 normal seeds 95% or a little more: three of 128 patterns are cut off at either end."""
    rng = np.random.default_rng(6)
    trials, hits = 1_000, 0
    for _ in range(trials):
        interval = mean_interval(rng.normal(10.0, 2.0, 7).tolist())
        assert interval is not None
        hits += interval.low <= 10.0 <= interval.high
    assert 0.935 <= hits / trials <= 0.972  # 1 - 6 / 128, within 2.5 standard errors


def test_a_band_is_the_interval_of_every_point() -> None:
    """Up to twelve seeds exactly; beyond, of subsets that are drawn."""
    few, many = (draws(7, points, claims=seeds) for seeds, points in ((8, 3), (14, 3)))
    columns = [flip_interval([curve[point] for curve in few], 0.05) for point in range(3)]
    assert flip_band(few, 0.05) == columns
    drawn = flip_band(many, 0.05)
    exact = [flip_interval([curve[point] for curve in many], 0.05) for point in range(3)]
    assert drawn is not None
    for here, there in zip(drawn, exact, strict=True):
        assert isinstance(there, Interval)
        assert here == pytest.approx(there, abs=0.1)


@pytest.mark.parametrize("seeds", [25, 40])
def test_subsets_drawn_in_parts_are_those_drawn_at_once(seeds: int) -> None:
    """Which subsets stand for all is no matter of memory; halves of a 64-bit draw go on, too."""
    whole = np.random.default_rng(DRAWN_WITH).integers(0, 2, (SAMPLE - 1, seeds))
    chosen, counts = _drawn(seeds, SAMPLE)
    assert np.array_equal(chosen.T, whole)
    assert np.array_equal(counts, np.count_nonzero(whole, axis=1))


def test_intervals_of_many_seeds_share_what_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing subsets of hundreds of seeds takes longer than all else: it is done once."""
    (values,) = draws(1, ENUMERATED + 5)
    first = flip_interval(values, 0.05)
    monkeypatch.setattr("numpy.random.default_rng", None)
    assert flip_interval([2.0 * value for value in values], 0.05) != first
    assert flip_interval(values, 0.05) == first
