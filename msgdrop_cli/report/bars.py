"""What broken links and other channels do to each variant, as bars side by side."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from msgdrop_cli.analysis.summary import Group, Summary
from msgdrop_cli.definition.channel import MANY, Channel, only_links, played_how, title_of
from msgdrop_cli.report.captions import footer, scale, spread_note
from msgdrop_cli.report.drawn import Drawn, channel_rows, line_rows, spread_columns
from msgdrop_cli.report.lettering import LINE, width, wrapped
from msgdrop_cli.report.looks import Shown, shown_arms
from msgdrop_cli.report.marks import label_ends, measure_axis, spread_marks
from msgdrop_cli.report.reference_lines import reference_lines
from msgdrop_cli.report.style import AXES, INK, QUIET, Size, canvas, tint

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BETWEEN = 0.9
"""Between the bars of two variants, in bars."""
_NAME, _TICK = 8.5, 7.5
"""Sizes of a variant's name and of the channels below its bars, in points."""
_NARROWEST, _ROOM = 1.15, 0.1
"""A longer name has at least this many inches a line, and so many to the next name."""
_PER_BAR, _BESIDE = 0.42, 1.75
"""Inches of a figure for each bar, and of them what lies beside the axes."""

NO_EPSILON = " These act without an epsilon."
"""Of the reference policies beside bars of policies that act at random at times."""


def draw_channels(summary: Summary, group: Group) -> Drawn | None:
    """The headline of each variant through each evaluated channel, as bars side by side."""
    metric = summary.metrics(group.environment).headline
    shown = [each for each in shown_arms(summary, group) if each.arm.rows]
    channels = sorted({row.channel for each in shown for row in each.arm.rows})
    if not 2 <= len(channels) < MANY:
        return None
    rows = [row for each in shown for row in each.arm.rows]
    values = [value for row in rows if row.metric == metric.name for value in row.by_seed.values()]
    lines = reference_lines(summary, group, metric, values)
    below = footer(
        summary,
        group,
        [each.arm for each in shown],
        f"{metric.label} = {metric.formula}; {played_how(channels)}, "
        f"the same policies {_through(channels)}. "
        + spread_note({len(row.by_seed) for row in rows}, "bar", "line")
        + " Dots: seeds."
        + lines.note
        + (NO_EPSILON if lines.note and any(each.epsilon for each in channels) else ""),
    )
    bar = _bar_width([each.label for each in shown], channels)
    slot = bar * (len(channels) + _BETWEEN)
    names = [wrapped(each.label, slot - _ROOM, _NAME, "bold") for each in shown]
    figure, axes = canvas(
        f"{title_of(channels)}, {scale(group)}",
        below,
        size=Size(bar * _bars(len(shown), len(channels)), AXES.height),
        below=(max(map(len, names)) - 1) * _NAME * LINE,
    )
    _draw_arms(axes, shown, channels, metric.name, names)
    axes.tick_params(axis="x", length=0)
    measure_axis(axes, metric, values)
    lines.draw(axes)
    label_ends(axes, lines.ends)
    return Drawn(
        figure=figure,
        group=group,
        arms=[each.arm for each in shown],
        columns=spread_columns("channel"),
        rows=[*channel_rows(shown, metric.name), *line_rows(lines.shown.items(), 1)],
    )


def _draw_arms(
    axes: "Axes",
    shown: Sequence[Shown],
    channels: Sequence[Channel],
    metric: str,
    names: Sequence[Sequence[str]],
) -> None:
    """The bars of each arm above its name, each above the word of its channel."""
    ticks, tick_names = [], []
    for rank, (arm, _, look) in enumerate(shown):
        first = rank * (len(channels) + _BETWEEN)
        for column, channel in enumerate(channels):
            ticks.append(first + column)
            tick_names.append(channel.word)
            row = arm.row(metric, channel)
            if row is None:
                continue
            shade = tint(look.colour, 1.0 - 0.72 * column / (len(channels) - 1))
            axes.bar(
                first + column, row.mean, 0.86, color=shade, edgecolor=look.colour, linewidth=0.8
            )
            spread_marks(axes, first + column, row, INK, width=0.3)
        _name_below(axes, first + (len(channels) - 1) / 2.0, names[rank])
    axes.set_xticks(ticks, tick_names, fontsize=_TICK, color=QUIET)


def _through(channels: Sequence[Channel]) -> str:
    """What the evaluations differ in."""
    return "with part of the links broken" if only_links(channels) else "through each channel"


def _bars(arms: int, channels: int) -> float:
    """Width of the axes in bars, with matplotlib's margins of 5% at both ends."""
    return 1.1 * ((arms - 1) * (channels + _BETWEEN) + channels - 1 + 0.86)


def _bar_width(labels: Sequence[str], channels: Sequence[Channel]) -> float:
    """Inches of a bar and the gap beside it, so that neither names nor channels overlap."""
    bars = len(labels) * len(channels)
    usual = max(AXES.width, _PER_BAR * bars - _BESIDE) / _bars(len(labels), len(channels))
    name = min(_NARROWEST, max(width(label, _NAME, "bold") for label in labels)) + _ROOM
    tick = max(width(each.word, _TICK) for each in channels)
    return max(usual, name / (len(channels) + _BETWEEN), tick + _ROOM / 2.0)


def _name_below(axes: "Axes", place: float, lines: Sequence[str]) -> None:
    """A variant's name below the tick labels of its bars."""
    axes.annotate(
        "\n".join(lines),
        (place, 0),
        xycoords=("data", "axes fraction"),
        xytext=(0, -18),
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize=_NAME,
        fontweight="bold",
        color=INK,
    )
