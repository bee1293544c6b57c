"""What is measured of a game. No torch in this file: records are read with it, too."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Metric:
    """A ratio of two sums over steps or episodes: `scale * sum(count) / sum(per)`.

    `per` is `steps` or `episodes`; `count` is a key of `Transition.info`, `return` (the reward
    summed over agents), `steps`, or `finished` (episodes that ended by themselves).
    """

    count: str
    per: str
    scale: float
    better: Literal["higher", "lower"]
    meaning: str

    def ratio(self, sums: Mapping[str, float]) -> float | None:
        """From sums over a window or over episodes; None if there was nothing to divide by."""
        per = sums[self.per]
        return self.scale * sums[self.count] / per if per else None
