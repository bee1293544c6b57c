"""How well an encoder reconstructs what is seen, as `run.json` says it of the runs that use it."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Squared errors of one channel of an observation that was not learnt from."""

    error: float
    """Of what the decoder makes of the message."""
    of_the_mean: float
    """Of saying the mean instead."""

    @property
    def share_left(self) -> float:
        """What of it the message leaves; all of nothing."""
        return self.error / self.of_the_mean if self.of_the_mean > 0 else 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Pretraining:
    """What came of it."""

    folder: str
    """In `pretrained` of the results folder where it was made."""
    samples: int
    """Observations that were learnt from."""
    errors: Mapping[str, Errors]
    """By the names of the channels."""
