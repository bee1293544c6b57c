"""What would probably decide an open claim: a forecast, and never one of a look that cannot."""

from dataclasses import replace
from pathlib import Path

import pytest

from msgdrop_cli.analysis.prospects import Prospect
from msgdrop_cli.definition.spec import Registration
from tests.claims import AT_SIX, arms, verdict_on

SHIPPED = Registration(looks=(6, 10, 14, 20), alpha_spent=(0.015, 0.025, 0.035, 0.05))


def forecast(root: Path, differences: list[int], rule: Registration) -> Prospect | None:
    """Of a claim whose seeds differ by this much; each run took a second."""
    better = [50 + each for each in differences]
    return verdict_on(arms(root, better, [50] * len(differences)), rule=rule).prospect


def test_a_large_effect_waits_for_a_look_that_can_decide(tmp_path: Path) -> None:
    """Six seeds cannot have a p of 0.015: the forecast is ten, six more runs of each arm."""
    assert forecast(tmp_path, [9, 10, 11, 10], SHIPPED) == Prospect(10, True)


def test_a_look_that_can_decide_is_enough(tmp_path: Path) -> None:
    """Where six seeds may spend 0.04 they are the forecast."""
    rule = replace(AT_SIX, margin={})
    assert forecast(tmp_path, [9, 10, 11, 10], rule) == Prospect(6, True)


def test_a_look_that_had_been_seen_decides_nothing(tmp_path: Path) -> None:
    """The forecast is of the one after it."""
    rule = replace(AT_SIX, margin={}, seen=6)
    assert forecast(tmp_path, [9, 10, 11, 10], rule) == Prospect(8, True)


@pytest.mark.parametrize("differences", [[9, 10], [0, 0, 0], [10, -10, 9, -9, 1]])
def test_there_is_none_of_nothing(tmp_path: Path, differences: list[int]) -> None:
    """Two seeds tell no spread, equal ones have none, and a hundredth of it is out of reach."""
    assert forecast(tmp_path, differences, SHIPPED) is None


def test_more_seeds_than_are_registered(tmp_path: Path) -> None:
    """Half a standard deviation, about: it is said that no registered look would do."""
    found = forecast(tmp_path, [12, -8, 9, -5, 6], SHIPPED)
    assert found is not None
    assert (found.seeds > 20, found.registered) == (True, False)


@pytest.mark.parametrize(
    ("differences", "why"),
    [
        ([9, 10], "below 3 seeds there is no forecast"),
        ([5, 5, 5], "all seeds differ alike, so there is no forecast"),
        ([10, -10, 9, -9, 1], "as it stands 100 seeds would probably not decide"),
        ([9, 10, 11, 10], "10 would probably decide"),
    ],
)
def test_an_open_claim_says_what_would_decide_it_or_why_nobody_knows(
    tmp_path: Path, differences: list[int], why: str
) -> None:
    """Before the first look as after it; how long that takes, its estimate beside it says."""
    better = [50 + each for each in differences]
    verdict = verdict_on(arms(tmp_path, better, [50] * len(differences)), rule=SHIPPED)
    assert verdict.verdict == "undecided"
    look = "first registered look at 6 seeds, which can decide nothing: 10 can"
    assert verdict.reason.split("; ")[:2] == [look, why]
    assert bool(verdict.prospect) != bool(verdict.unforeseen)
    assert verdict.prospect or why == verdict.unforeseen
