"""What makes waterworld hard, against what the throw-away trials found."""

import dataclasses

import pytest

from msgdrop_envs.waterworld.config import PAPER
from tests.test_reference_policies import play


@pytest.mark.parametrize(("catchers", "least", "most"), [(1, 75.0, 95.0), (2, 2.0, 6.0)])
def test_cooperation_is_what_makes_it_hard(catchers: int, least: float, most: float) -> None:
    """Trials, at random: 86 catches if one pursuer were enough, 4 if two were."""
    easier = dataclasses.replace(PAPER["waterworld-n8"], catchers=catchers)
    assert least <= play(easier, "random", games=16)["catches"].mean() <= most
