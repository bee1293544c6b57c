"""What claims are about, in numbers: how much better one arm is than another, paired by seed.

Means that lie within a line's width of each other say little; the differences of pairs have much
narrower intervals, and an axis of their own.
"""

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

from msgdrop_cli.analysis.intervals import mean_interval
from msgdrop_cli.analysis.pairs import Pair
from msgdrop_cli.analysis.statistics import Interval, mean, total
from msgdrop_cli.analysis.summary import Arm, Group, Summary
from msgdrop_cli.report.captions import footer, scale, spread_note
from msgdrop_cli.report.drawn import Drawn, ends
from msgdrop_cli.report.lettering import LINE, width, wrapped
from msgdrop_cli.report.looks import Shown, shown_arms
from msgdrop_cli.report.style import INK, LABEL, ONE_COLUMN, QUIET, TICK, Size, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROW, _HEAD, _WIDEST = 0.24, 0.3, 1.65
"""Inches of a comparison's row, of a heading, and of a comparison's name at most."""
_COLUMNS = ("better", "worse", "measure", "channel")
PAIRED = "Paired by seed; above 0 the first one is better, as the claim says."
"""For footers."""


def draw_differences(summary: Summary, group: Group, pairs: Sequence[Pair]) -> Drawn | None:
    """Each comparison as one number: mean, interval and every seed, below what is compared."""
    if not pairs:
        return None
    pairs = sorted(pairs, key=_head_key)
    shown = {each.arm.variant: each for each in shown_arms(summary, group)}
    metric = summary.metrics(group.environment).headline
    arms = arms_of(pairs)
    below = footer(
        summary,
        group,
        arms,
        f"{metric.label} = {metric.formula}. {PAIRED} "
        + spread_note({len(pair.differences) for pair in pairs}, "mark", "line")
        + " Dots: seeds.",
        lost="counted as the worst value",
    )
    names = [
        wrapped(versus(shown[p.claim.better], shown[p.claim.worse]), _WIDEST, TICK) for p in pairs
    ]
    heads = len({_head(pair) for pair in pairs})
    left = max(width(line, TICK) for name in names for line in name) + 0.2
    tall = total(max(_ROW, len(name) * TICK * LINE + 0.08) for name in names) + heads * _HEAD
    size = Size(max(1.2, ONE_COLUMN - left - 0.2), tall)
    title = f"Differences, {scale(group)}"
    figure, axes = canvas(title, below, size=size, left=left, right=0.2)
    rows = _draw_rows(axes, pairs, names, left)
    axes.set_xlabel(f"how much better, {metric.label}", fontsize=LABEL, color=INK, loc="right")
    axes.axvline(0.0, color=QUIET, linewidth=0.8, zorder=1)
    columns = (*_COLUMNS, "seed", "difference", "low", "high")
    return Drawn(figure=figure, group=group, arms=arms, columns=columns, rows=rows)


def _draw_rows(
    axes: "Axes", pairs: Sequence[Pair], names: Sequence[Sequence[str]], left: float
) -> list[Sequence[Any]]:
    """Draw a row for each pair below its heading; returns what is drawn, as lines.

    left: inches left of the axes, where the names stand.
    """
    place, ticks = 0.0, list[float]()
    lines: list[Sequence[Any]] = []
    heights = dict(zip(map(id, pairs), names, strict=True))
    for head, alike in groupby(pairs, _head):
        place += _HEAD
        axes.annotate(
            head, (0, place - 0.06), xycoords=("axes fraction", "data"), xytext=(9 - 72 * left, 0),
            textcoords="offset points", fontsize=TICK, fontweight="bold", color=INK, va="bottom",
        )  # fmt: skip
        for pair in alike:
            tall = max(_ROW, len(heights[id(pair)]) * TICK * LINE + 0.08)
            place += tall
            middle = place - tall / 2.0
            ticks.append(middle)
            values = list(pair.differences.values())
            interval, average = mean_interval(values), mean(values)
            _draw_pair(axes, middle, values, average, interval)
            claim = pair.claim
            channel = claim.channel.key if claim.measure == "evaluation" else None
            about = (claim.better, claim.worse, claim.measure, channel)
            lines.append((*about, None, average, *ends(interval)))
            lines += [(*about, seed, each, None, None) for seed, each in pair.differences.items()]
    axes.set_ylim(place, 0.0)
    axes.set_yticks(ticks, ["\n".join(name) for name in names])
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(visible=False, axis="y")
    axes.grid(axis="x", color="#E6E6E6", linewidth=0.8)
    return lines


def _draw_pair(
    axes: "Axes", place: float, values: Sequence[float], average: float, interval: Interval | None
) -> None:
    below = [place + 0.07] * len(values)
    axes.scatter(values, below, s=7, color=QUIET, alpha=0.6, linewidths=0, zorder=2)
    if interval:
        axes.hlines(place - 0.02, *interval, color=INK, linewidth=1.6, zorder=3)
    axes.scatter([average], [place - 0.02], s=60, marker="|", color=INK, linewidths=1.6, zorder=4)


def _head(pair: Pair) -> str:
    """What is compared, over the rows that compare it."""
    if pair.claim.measure == "learning":
        return "while training"
    return "after training" + f", {pair.claim.channel.short}" * (pair.claim.channel.key != _PLAIN)


_PLAIN = "links:0"
"""The channel that takes nothing."""


def _head_key(pair: Pair) -> tuple[bool, str]:
    return pair.claim.measure != "learning", pair.claim.channel.key


def versus(better: Shown, worse: Shown) -> str:
    """What two arms are called together."""
    return f"{better.label} vs {worse.label}"


def arms_of(pairs: Sequence[Pair]) -> list[Arm]:
    """Those of all pairs, each once."""
    arms = [arm for pair in pairs for arm in (pair.better, pair.worse)]
    return list({id(arm): arm for arm in arms}.values())
