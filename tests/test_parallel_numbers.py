"""What `parallel_env` takes for a seed and for the number of an action."""

from typing import Any

import pytest

from msgdrop_envs.parallel import parallel_env


@pytest.mark.parametrize("seed", [True, -1, 2.0, "3", [1, 2]])
def test_a_seed_is_a_whole_number(seed: Any) -> None:
    """From 0 on; True is none, though Python counts by it."""
    with pytest.raises(ValueError, match="a seed is a whole number from 0 on, not "):
        parallel_env("pursuit-n6").reset(seed=seed)


def test_true_is_no_action() -> None:
    """It would be action 1."""
    game = parallel_env("pursuit-n6")
    game.reset(seed=1)
    with pytest.raises(ValueError, match="True is not an action number"):
        game.step(dict.fromkeys(game.agents, True))
