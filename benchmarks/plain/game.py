"""What the loop, the memory and the learners ask of a game."""

from typing import Any, Protocol

import numpy.typing as npt

Array = npt.NDArray[Any]


class Game(Protocol):
    """One game."""

    agents: int
    observation: int
    """Numbers that an agent sees."""
    dtype: Any
    """Of the observations."""
    actions: int
    """What an agent can choose from; 0 where an action is `action_size` numbers."""
    action_size: int
    time_limit: int

    def reset(self) -> Array:
        """Start anew; returns the observations [N, O]."""

    def step(self, actions: Any) -> tuple[Array, Any, bool]:
        """Returns observations [N, O], rewards [N], and whether the game has ended by itself."""
