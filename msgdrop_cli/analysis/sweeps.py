"""What becomes of each variant while a channel gets worse: area under the curve, and the fall.

A seed's curve is its headline at each setting. Spreads are those of the seeds themselves, lowest to
highest: with six of them no interval of an area is worth more.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from msgdrop_cli.analysis.metrics import NamedMetric
from msgdrop_cli.analysis.statistics import mean, total
from msgdrop_cli.analysis.summary import Arm, Group, Row, Summary
from msgdrop_cli.definition.sweep import Sweep

NEVER = float("inf")
"""Where a curve falls that never does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Swept:
    """One arm through all channels of a sweep."""

    arm: Arm
    rows: tuple[Row, ...]
    """One for each setting."""
    areas: Mapping[int, float]
    """Of each seed: the mean height of its curve over the range, in the metric's unit."""
    falls: Mapping[int, float]
    """Of each seed that FDC has, too: the setting from which it is worse than FDC, or NEVER."""
    fall: float | None
    """The same of the curves of means; None without FDC."""

    @property
    def area(self) -> float:
        """The mean over seeds."""
        return mean(list(self.areas.values()))


def sweep_arms(summary: Summary, group: Group, sweep: Sweep) -> list[Swept]:
    """The arms of a group that were evaluated through every channel of the sweep."""
    metric = summary.metrics(group.environment).headline
    curves = {}
    for arm in summary.arms_of(group):
        rows = [arm.row(metric.name, channel) for channel in sweep.channels]
        if all(row is not None for row in rows):
            curves[id(arm)] = (arm, tuple(row for row in rows if row is not None))
    deaf = [rows for arm, rows in curves.values() if hears_nobody(arm)]
    return [
        _swept(arm, rows, deaf[0] if deaf and not hears_nobody(arm) else None, sweep, metric)
        for arm, rows in curves.values()
    ]


def hears_nobody(arm: Arm) -> bool:
    """Whether its network sees the own observation only, as FDC's."""
    return bool(arm.setup["algorithm"].get("network") == "own")


def _swept(
    arm: Arm, rows: tuple[Row, ...], deaf: tuple[Row, ...] | None, sweep: Sweep, metric: NamedMetric
) -> Swept:
    seeds = [seed for seed in rows[0].by_seed if all(seed in row.by_seed for row in rows)]
    curves = {seed: [row.by_seed[seed] for row in rows] for seed in seeds}
    falls, fall = {}, None
    if deaf is not None:
        sign = 1.0 if metric.higher_is_better else -1.0
        ahead = [sign * (row.mean - other.mean) for row, other in zip(rows, deaf, strict=True)]
        fall = first_below(sweep.values, ahead)
        for seed in seeds:
            if all(seed in row.by_seed for row in deaf):
                own = [row.by_seed[seed] for row in deaf]
                gains = [sign * (a - b) for a, b in zip(curves[seed], own, strict=True)]
                falls[seed] = first_below(sweep.values, gains)
    return Swept(
        arm=arm,
        rows=rows,
        areas={seed: mean_height(sweep.values, curve) for seed, curve in curves.items()},
        falls=falls,
        fall=fall,
    )


def mean_height(places: Sequence[float], heights: Sequence[float]) -> float:
    """The area under straight lines through the points, divided by the width of the range."""
    steps = zip(pairwise(places), pairwise(heights), strict=True)
    area = total((right - left) * (low + high) / 2.0 for (left, right), (low, high) in steps)
    return area / (places[-1] - places[0])


def first_below(places: Sequence[float], heights: Sequence[float]) -> float:
    """Where straight lines through the points first go below 0; NEVER if they do not."""
    if heights[0] < 0.0:
        return places[0]
    for (left, right), (before, after) in zip(pairwise(places), pairwise(heights), strict=True):
        if after < 0.0:
            return left + (right - left) * before / (before - after)
    return NEVER
