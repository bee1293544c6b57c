"""The symmetric e-process: fair odds at every stop, and a second computation of all of it."""

import math
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from statistics import fmean

import numpy as np
import pytest

from msgdrop_cli.analysis import e_process as e_process_module
from msgdrop_cli.analysis.e_process import BETS, anytime, e_process, mean_at_any_stop
from tests.claims import AT_SIX, HIGH, LOW, arms, verdict_on

SIZES = (3.0, 0.2, 1.1, 7.5, 1.1, 2.6, 0.9, 4.0, 0.3, 1.7)


def by_the_book(differences: Sequence[float], bets: Sequence[float]) -> list[float]:
    """The wealth after each seed, bet by bet and seed by seed, with cosh as it is written."""
    purses = [1.0 for _ in bets]
    wealth = []
    for number, difference in enumerate(differences, start=1):
        scale = math.sqrt(fmean(each * each for each in differences[:number]))
        for rank, bet in enumerate(bets):
            x = bet * difference / scale if scale else 0.0
            purses[rank] *= math.exp(x) / math.cosh(x)
        wealth.append(fmean(purses))
    return wealth


@pytest.mark.parametrize("sides", [1, 2])
def test_the_wealth_is_what_the_formula_says(sides: int) -> None:
    """Two computations agree; of a row with zeros, too."""
    bets = BETS if sides == 1 else [*BETS, *(-bet for bet in BETS)]
    for row in ([0.0, 1.0, -2.0, 0.0, 3.0, 0.5, 4.0], [0.0], [-1e-6, 2e-6, 3e-6]):
        assert e_process(row, sides) == pytest.approx(by_the_book(row, bets), rel=1e-12)


@pytest.mark.parametrize("sides", [1, 2])
def test_odds_are_fair_whatever_the_sizes(sides: int) -> None:
    """Over all patterns of signs the wealth after every seed is 1 on average: a martingale."""
    paths = np.array(
        [
            e_process([sign * size for sign, size in zip(signs, SIZES, strict=True)], sides)
            for signs in product((1, -1), repeat=len(SIZES))
        ]
    )
    assert paths.mean(axis=0) == pytest.approx(np.ones(len(SIZES)), rel=1e-12)
    for alpha in (0.2, 0.05, 0.01):  # Ville: of those who stop when it pleases them, too
        assert (paths.max(axis=1) >= 1.0 / alpha).mean() <= alpha


@pytest.mark.parametrize("seeds", [6, 9, 100])
@pytest.mark.parametrize("shift", [0.0, 30.0])
def test_means_that_are_ruled_out_unseen_are_not_left(seeds: int, shift: float) -> None:
    """The interval is the one that is found by the wealth of every place, to the last bit."""
    values = np.random.default_rng(seeds).standard_t(2, seeds) + shift
    values[0] = values[1]
    found = mean_at_any_stop(values.tolist(), 0.05)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(e_process_module, "_may_be_left", lambda _, means, __: np.isfinite(means))
        patched.setattr(e_process_module, "_AT_ONCE", 10_000)
        assert mean_at_any_stop(values.tolist(), 0.05) == found is not None


def test_units_do_not_matter() -> None:
    """Neither to the wealth nor, but for the unit, to the interval."""
    row = [1.0, 2.5, -0.5, 3.0, 1.0, 2.0, 1.5, 0.1]
    first, second = anytime(row, 2), anytime([1000.0 * each for each in row], 2)
    assert first is not None
    assert second is not None
    assert first.interval is not None
    assert second.interval is not None
    assert second.e == pytest.approx(first.e)
    assert [*second.interval] == pytest.approx([1000.0 * end for end in first.interval], rel=1e-6)


def test_the_interval_is_what_the_gamblers_left_over() -> None:
    """Every mean is tried in another way, from far outside: the outermost that is left."""
    row = [1.0, 2.5, -0.5, 3.0, 1.0, 2.0, 1.5, 0.1, 2.2]
    found = mean_at_any_stop(row, 0.05)
    assert found is not None
    bets = [*BETS, *(-bet for bet in BETS)]
    tried = [-10.0 + 0.01 * step for step in range(2400)]
    left = [t for t in tried if by_the_book([d - t for d in row], bets)[-1] < 20.0]
    assert [*found] == pytest.approx([min(left), max(left)], abs=0.01)
    assert found.low < fmean(row) < found.high


def test_few_seeds_leave_everything_over() -> None:
    """Five that agree are not worth 20; six are."""
    assert mean_at_any_stop([1.0, 1.1, 0.9, 1.2, 1.0], 0.05) is None
    assert mean_at_any_stop([1.0, 1.1, 0.9, 1.2, 1.0, 1.1], 0.05) is not None
    assert mean_at_any_stop([2.0] * 6, 0.05) == (2.0, 2.0)
    assert anytime([], 2) is None


def test_p_is_of_the_most_that_it_ever_was() -> None:
    """Who stopped then was as much in the right: a bad seed afterwards takes nothing back."""
    row = [1.0] * 8
    before, after = anytime(row, 2), anytime([*row, -5.0], 2)
    assert before is not None
    assert after is not None
    assert after.e < before.e
    assert after.p == before.p


def test_it_stands_beside_the_verdict_and_decides_nothing(tmp_path: Path) -> None:
    """Without a registration the claim stays open, however clear; with one the look decides."""
    open_, decided = (
        verdict_on(arms(tmp_path / str(rule), HIGH, LOW), rule=rule) for rule in (None, AT_SIX)
    )
    assert (open_.verdict, decided.verdict) == ("estimate", "supported")
    for each in (open_, decided):
        assert each.anytime is not None
        assert each.anytime.seeds == 6
        assert "at any stop, alone: p 0.045, difference of 6 seeds [" in each.reason


def test_it_is_silent_where_it_says_nothing(tmp_path: Path) -> None:
    """The numbers are there for programs; the sentence is not."""
    verdict = verdict_on(arms(tmp_path, [9, 1, 8, 2, 9, 1], [1, 9, 2, 8, 1, 9]))
    assert verdict.anytime is not None
    assert "at any stop" not in verdict.reason


def test_it_is_of_seeds_one_to_n(tmp_path: Path) -> None:
    """Whoever picks seeds picks the result: after a gap nothing counts."""
    records = arms(tmp_path, [*HIGH, 11], [*LOW, 1])
    verdict = verdict_on([record for record in records if record.seed != 3])
    assert verdict.anytime is not None
    assert verdict.anytime.seeds == 2
