"""Trained as, evaluated through: every variant and every channel as a map with numbers."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from msgdrop_cli.analysis.summary import Group, Row, Summary
from msgdrop_cli.definition.channel import MANY, played_how
from msgdrop_cli.report.captions import footer, scale
from msgdrop_cli.report.drawn import Drawn, channel_rows, spread_columns
from msgdrop_cli.report.lettering import width, wrapped
from msgdrop_cli.report.looks import shown_arms
from msgdrop_cli.report.style import INK, Size, canvas, tint

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DARKEST = "#08519C"
_CELL = Size(0.72, 0.42)
"""Inches of a cell."""
_NAME, _NUMBER = 8.0, 7.5
"""Sizes of names and numbers, in points."""
_WIDEST = 2.2
"""Of variants' names, in inches."""
_MARGIN = 0.65
"""Inches that the canvas leaves left of its axes for ticks."""


def draw_matrix(summary: Summary, group: Group) -> Drawn | None:
    """The headline of each variant (rows) through each channel (columns); dark is better."""
    metric = summary.metrics(group.environment).headline
    shown = [each for each in shown_arms(summary, group) if each.arm.rows]
    channels = sorted({row.channel for each in shown for row in each.arm.rows})
    if len(channels) < MANY:
        return None
    table = [[each.arm.row(metric.name, channel) for channel in channels] for each in shown]
    found = [row.mean for rows in table for row in rows if row]
    low, high = min(found), max(found)
    better = "higher" if metric.higher_is_better else "lower"
    below = footer(
        summary,
        group,
        [each.arm for each in shown],
        f"{metric.label} = {metric.formula} ({better} is better, and darker); "
        f"{played_how(channels)}, the same policies through each channel; mean over seeds, in "
        "small figures the lowest and the highest seed.",
    )
    words = [channel.word for channel in channels]
    names = [wrapped(each.label, _WIDEST, _NAME) for each in shown]
    left = max(0.0, max(width(line, _NAME) for name in names for line in name) - _MARGIN)
    tall = max(width(word, _NAME) for word in words)
    size = Size(_CELL.width * len(channels) + left, _CELL.height * len(shown))
    figure, axes = canvas(f"Channels, {scale(group)}", below, size=size, right=0.3, below=tall)
    box, share = axes.get_position(), left / size.width
    axes.set_position((box.x0 + share * box.width, box.y0, (1.0 - share) * box.width, box.height))
    for rank, rows in enumerate(table):
        for column, row in enumerate(rows):
            if row is not None:
                worth = (row.mean - low) / (high - low) if high > low else 0.5
                _cell(axes, column, rank, row, worth if metric.higher_is_better else 1.0 - worth)
    _name_both(axes, words, names)
    return Drawn(
        figure=figure,
        group=group,
        arms=[each.arm for each in shown],
        columns=spread_columns("channel"),
        rows=[*channel_rows(shown, metric.name)],
    )


def _name_both(axes: "Axes", columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Names of columns and rows, and nothing else around the cells."""
    axes.set_xlim(-0.5, len(columns) - 0.5)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xticks(range(len(columns)), columns, rotation=90, fontsize=_NAME)
    axes.set_yticks(range(len(rows)), ["\n".join(row) for row in rows], fontsize=_NAME)
    axes.tick_params(length=0, labelcolor=INK)
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _cell(axes: "Axes", column: int, rank: int, row: Row, worth: float) -> None:
    """A rectangle as dark as it is worth, from 0 to 1, with the mean and the seeds' range."""
    from matplotlib.patches import Rectangle

    shade = tint(_DARKEST, 0.08 + 0.92 * worth)
    axes.add_patch(Rectangle((column - 0.48, rank - 0.46), 0.96, 0.92, color=shade, linewidth=0))
    seeds = list(row.by_seed.values())
    between = f"{min(seeds):.3g} to {max(seeds):.3g}" if len(seeds) > 1 else "1 seed"
    ink = "white" if worth > 0.5 else INK
    for height, text, size in ((-0.12, f"{row.mean:.3g}", _NUMBER), (0.25, between, 6.0)):
        axes.text(column, rank + height, text, fontsize=size, ha="center", va="center", color=ink)
