"""What several figures draw the same way: the axis of a metric, seeds, names beside line ends."""

from collections.abc import Sequence
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, NamedTuple

from msgdrop_cli.analysis.metrics import NamedMetric
from msgdrop_cli.analysis.summary import Row
from msgdrop_cli.report.lettering import LINE, drawable_name, wrapped
from msgdrop_cli.report.style import AXES, INK, LABEL, inches

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIZE = 8.0
"""Of the names beside line ends, in points."""
_WIDEST = 2.3
"""Of these names, in inches."""
_GAP = 0.055 * AXES.height
"""From one name's middle to the next one's, in inches, for names of one line."""
_BEYOND = 0.06
"""How far names may stand above or below the axes, as a share of their height."""
_LEAD = AXES.width
"""Width of axes, in inches, from which on leads no longer grow with them."""


class End(NamedTuple):
    """A name beside the axes and the value that it belongs to."""

    lines: list[str]
    value: float
    colour: str
    marker: str

    @property
    def height(self) -> float:
        """In inches, with the gap to its neighbours."""
        return _GAP + (len(self.lines) - 1) * _SIZE * LINE


def end(label: str, value: float, colour: str, marker: str = "") -> End:
    """A drawable label in as many lines as it needs."""
    return End(wrapped(label, _WIDEST, _SIZE), value, colour, marker)


def measure_axis(axes: "Axes", metric: NamedMetric, values: Sequence[float]) -> None:
    """Name the metric; begin at 0 unless something lies below, for bars and rates are amounts."""
    better = "higher" if metric.higher_is_better else "lower"
    name = drawable_name(f"{metric.label} ({better} is better)")
    lines = wrapped(name, inches(axes).height, LABEL)
    axes.set_ylabel("\n".join(lines), fontsize=LABEL, color=INK)
    if min(values, default=0.0) >= 0.0:
        axes.set_ylim(bottom=0.0)


def env_steps_axis(axes: "Axes", steps: int, name: bool = True) -> None:
    """The length of the training, in thousands or millions; its name if it is to be there."""
    unit, word = (1e6, "million ") if steps >= 1_000_000 else (1e3, "thousand ")
    axes.set_xlim(0, steps)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value / unit:g}")
    if name:
        axes.set_xlabel(f"{word}env steps", fontsize=LABEL, color=INK)


def spread_marks(axes: "Axes", place: float, row: Row, colour: str, width: float) -> None:
    """The interval as a line, and each seed as a small dot to the right of it.

    Both have a white edge, for they may stand on a dark bar.
    """
    seeds = len(row.by_seed)
    beside = [place + width * (0.3 + 0.7 * rank / max(1, seeds - 1)) for rank in range(seeds)]
    axes.scatter(
        beside, list(row.by_seed.values()), s=9, color=colour, alpha=0.7, edgecolor="white",
        linewidths=0.3, zorder=3,
    )  # fmt: skip
    if row.interval:
        axes.vlines(place, *row.interval, color="white", linewidth=3.0, zorder=3)
        axes.vlines(place, *row.interval, color=colour, linewidth=1.6, zorder=3)


def label_ends(axes: "Axes", ends: Sequence[End]) -> None:
    """Write each name beside the axes at its value's height, a lead between, none on another."""
    bottom, top = axes.get_ylim()
    size = inches(axes)
    values = [(each.value - bottom) / (top - bottom) for each in ends]
    heights = [each.height / size.height for each in ends]
    places = spread(values, heights, low=-_BEYOND, high=1.0 + _BEYOND)
    unit = min(1.0, _LEAD / size.width)
    names = 1.0 + unit * (0.058 if any(each.marker for each in ends) else 0.05)
    for (lines, _, colour, marker), value, place in zip(ends, values, places, strict=True):
        axes.plot(
            [1.0 + unit * step for step in (0.0, 0.012, 0.028, 0.04)],
            [value, value, place, place],
            color=colour,
            linewidth=1.2,
            marker=marker,
            markevery=[3],
            markersize=5.0,
            markeredgecolor="white",
            markeredgewidth=0.5,
            transform=axes.transAxes,
            clip_on=False,
        )
        axes.text(
            names,
            place,
            "\n".join(lines),
            transform=axes.transAxes,
            va="center",
            fontsize=_SIZE,
            color=INK,
        )


def spread(
    positions: Sequence[float], heights: Sequence[float], *, low: float, high: float
) -> list[float]:
    """Positions moved as little as needed so that things of these heights do not overlap.

    Order is kept. Clusters are laid out around their common middle, all between low and high if
    there is room. Least squares under order: pooling neighbours that violate it.
    """
    ranks = sorted(range(len(positions)), key=lambda rank: positions[rank])
    if not ranks:
        return []
    tall = [heights[rank] for rank in ranks]
    steps = [(below + above) / 2.0 for below, above in pairwise(tall)]
    stacked = list(accumulate(steps, initial=0.0))  # where each stands if all touch
    pools: list[list[float]] = []  # [sum, count] of positions that move together
    for rank, offset in zip(ranks, stacked, strict=True):
        pools.append([positions[rank] - offset, 1])
        while len(pools) > 1 and pools[-1][0] / pools[-1][1] < pools[-2][0] / pools[-2][1]:
            total, count = pools.pop()
            pools[-1] = [pools[-1][0] + total, pools[-1][1] + count]
    starts = [total / count for total, count in pools for _ in range(int(count))]
    lowest = low + tall[0] / 2.0
    highest = max(lowest, high - tall[-1] / 2.0 - stacked[-1])
    placed = list(positions)
    for rank, offset, start in zip(ranks, stacked, starts, strict=True):
        placed[rank] = min(max(start, lowest), highest) + offset
    return placed
