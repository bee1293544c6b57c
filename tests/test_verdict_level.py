"""The rule's level and power, on fewer studies than the benchmark's 100,000."""

import pytest

from benchmarks.verdict_level import MOST_SEEDS, NOISE, UNLIKE, simulate, stopped, unlike
from msgdrop_cli.definition.spec import Registration

RULE = Registration(looks=(6, 8, 10), alpha_spent=(0.02, 0.035, 0.05))
STUDIES = 1_000
HIGHEST = 0.05 + 3.0 * (0.05 * 0.95 / STUDIES) ** 0.5
"""Three standard errors above 5%."""


@pytest.mark.parametrize("noise", NOISE)
@pytest.mark.parametrize("better", [0, 1])
def test_at_most_one_study_in_twenty_is_wrong(noise: str, better: int) -> None:
    """About a claim of which nothing is true, whether all or half of the four are such."""
    found = simulate(RULE, STUDIES, better=better, effect=2.0, noise=noise)
    assert 0.01 < found.wrong <= HIGHEST


def test_large_effects_are_found_soon() -> None:
    """Two standard deviations by ten seeds nearly always; six seeds cannot tell by 2%."""
    found = simulate(RULE, 200, better=2, effect=2.0)
    assert found.right[0] == 0.0
    assert found.right[2] > 0.95
    assert found.wrong == 0.0
    assert found.seeds < 10.0


@pytest.mark.parametrize("noise", NOISE)
def test_whoever_stops_when_it_pleases_is_wrong_once_in_twenty(noise: str) -> None:
    """By the e-process, looked at after every one of sixty seeds, whatever the noise."""
    found = stopped(STUDIES, effect=0.0, noise=noise)
    assert max(found) <= MOST_SEEDS
    assert 0.01 < sum(map(bool, found)) / STUDIES <= 0.05


def test_the_e_process_finds_large_effects_soon() -> None:
    """Two standard deviations by ten seeds mostly, and none before six can."""
    found = stopped(200, effect=2.0)
    assert min(found) == 6
    assert sum(seed <= 10 for seed in found) > 0.9 * 200


def test_equal_means_are_not_enough() -> None:
    """Tested is whether a difference is as likely as its opposite, as docs/verdicts.md says."""
    found = {name: unlike(STUDIES, draw) for name, draw in UNLIKE.items()}
    assert found["normal, both"] <= 0.01 + 3.0 * (0.01 / STUDIES) ** 0.5
    assert found["normal, one thrice as wide"] <= 0.01 + 3.0 * (0.01 / STUDIES) ** 0.5
    assert found["one seed in ten collapses"] > 0.3
