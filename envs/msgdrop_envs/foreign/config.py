"""What is known of a game of other people without making it."""

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """One factory and what it makes, as `survey.py` finds it out."""

    factory: str
    """`package.module:factory`, which takes nothing and gives a `ParallelEnv`."""
    agent_names: tuple[str, ...]
    """All agents that there may be, in the order of the networks."""
    observation_size: int
    """Numbers that each agent sees."""
    actions: int = 0
    """What an agent can choose from; 0 where an action is numbers."""
    action_low: tuple[float, ...] = ()
    """The least of each number that makes an action; learners act from -1 to 1."""
    action_high: tuple[float, ...] = ()
    """The largest of each."""
    time_limit: int = 1_000
    """T, steps: where the game truncates its episodes (ours, if it does not)."""

    def __post_init__(self) -> None:
        if min(len(self.agent_names), self.observation_size, self.time_limit) < 1:
            raise ValueError("agent_names, observation_size and time_limit must not be empty")
        if len(self.action_low) != len(self.action_high):
            raise ValueError("action_low and action_high must have as many numbers")
        if (self.actions > 0) == (len(self.action_low) > 0):
            raise ValueError("exactly one of actions and action_low must be given")


def in_its_units(config: Config, actions: Tensor) -> Tensor:
    """Actions as the game takes them: numbers from -1 to 1 become those from its low to its high.

    actions: [..., A] float32, or any integers, which stay as they are.
    """
    if config.actions:
        return actions
    low, high = torch.tensor(config.action_low), torch.tensor(config.action_high)
    return (low + (actions + 1.0) / 2.0 * (high - low)).clamp(low, high)
