"""What claims are about while training: a panel for each two arms, paired, with its band."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from msgdrop_cli.analysis.curves import SMOOTHING_SHARE, Curve
from msgdrop_cli.analysis.differences import paired_curves
from msgdrop_cli.analysis.pairs import Pair
from msgdrop_cli.analysis.summary import Group, Summary
from msgdrop_cli.report.captions import footer, scale, spread_note
from msgdrop_cli.report.differences import PAIRED, arms_of, versus
from msgdrop_cli.report.drawn import Drawn, curve_rows
from msgdrop_cli.report.lettering import LINE, wrapped
from msgdrop_cli.report.looks import Look, shown_arms
from msgdrop_cli.report.marks import env_steps_axis
from msgdrop_cli.report.style import (
    AXES,
    INK,
    LABEL,
    QUIET,
    TICK,
    Size,
    canvas,
    inches,
    quiet_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ACROSS = 4
"""Panels in a row."""
_GAP, _TALL, _BETWEEN, _RIGHT = 0.26, 1.25, 0.5, 0.25
"""Inches between two panels, of a panel's height, between two rows, and right of all."""
_WIDE = AXES.width + 1.0 - _RIGHT
"""Inches of a row of panels."""


def draw_learning_differences(
    summary: Summary, group: Group, pairs: Sequence[Pair]
) -> Drawn | None:
    """Point by point: a panel for each two arms that claims compare while training."""
    pairs = [pair for pair in pairs if pair.claim.measure == "learning"]
    curves = paired_curves(pairs)
    if not curves:
        return None
    arms = arms_of(pairs)
    metric = summary.metrics(group.environment).headline
    below = footer(
        summary,
        group,
        arms,
        f"{metric.label} = {metric.formula}; of the exploring policy, in windows of training, "
        f"centred moving mean over {SMOOTHING_SHARE:.0%} of the run. {PAIRED} "
        + spread_note({len(curve.by_seed) for curve in curves.values()}, "line", "band"),
    )
    shown = {each.arm.variant: each for each in shown_arms(summary, group)}
    wide = (_WIDE + _GAP) / min(_ACROSS, len(curves)) - _GAP
    names = [wrapped(versus(shown[better], shown[worse]), wide, TICK) for better, worse in curves]
    head = max(map(len, names)) * TICK * LINE
    rows = math.ceil(len(curves) / _ACROSS)
    size = Size(_WIDE, rows * (_TALL + head + _BETWEEN) - head - _BETWEEN)
    title = f"Differences while training, {scale(group)}"
    figure, frame = canvas(title, below, size=size, right=_RIGHT, above=head)
    looks = [shown[better].look for better, _ in curves]
    panels = _panels(frame, names, wide, head)
    for axes, curve, look in zip(panels, curves.values(), looks, strict=True):
        _draw(axes, curve, look)
    _share_axes(panels, group.train_env_steps, list(curves.values()))
    _name_values(frame, f"how much better, {metric.label}")
    return Drawn(
        figure=figure,
        group=group,
        arms=arms,
        columns=("better", "worse", "env_steps", "difference", "low", "high"),
        rows=[(*names, *row) for names, curve in curves.items() for row in curve_rows(curve)],
    )


def _panels(
    frame: "Axes", names: Sequence[Sequence[str]], wide: float, head: float
) -> list["Axes"]:
    """Small axes in rows that fill the frame, each below its name."""
    figure, whole, size = frame.get_figure(), frame.get_position(), inches(frame)
    assert figure is not None
    x_inch, y_inch = whole.width / size.width, whole.height / size.height
    panels = []
    for rank, name in enumerate(names):
        row, column = divmod(rank, _ACROSS)
        left = whole.x0 + column * (wide + _GAP) * x_inch
        bottom = whole.y1 - (row * (_TALL + head + _BETWEEN) + _TALL) * y_inch
        axes = figure.add_axes((left, bottom, wide * x_inch, _TALL * y_inch))
        axes.set_title("\n".join(name), loc="left", fontsize=TICK, color=INK, pad=3)
        panels.append(quiet_axes(axes))
    return panels


def _draw(axes: "Axes", curve: Curve, look: Look) -> None:
    """Mean and band about the line of no difference."""
    axes.axhline(0.0, color=QUIET, linewidth=0.8)
    axes.plot(curve.env_steps, curve.mean, color=look.colour, linewidth=1.4)
    if curve.band:
        low, high = zip(*curve.band, strict=True)
        axes.fill_between(curve.env_steps, low, high, color=look.colour, alpha=0.25, linewidth=0)


def _share_axes(panels: Sequence["Axes"], steps: int, curves: Sequence[Curve]) -> None:
    """One scale for all; numbers at the left and names below, once."""
    edges = [edge for curve in curves for edge in (curve.band or zip(curve.mean))]
    values = [value for edge in edges for value in edge]
    low, high = min(*values, 0.0), max(*values, 0.0)
    gap = 0.06 * (high - low) or 1.0
    for rank, axes in enumerate(panels):
        axes.set_ylim(low - gap, high + gap)
        axes.set_yticks([tick for tick in axes.get_yticks() if low - gap <= tick <= high + gap])
        axes.tick_params(labelleft=rank % _ACROSS == 0)
        axes.locator_params(axis="x", nbins=2)
        env_steps_axis(axes, steps, name=rank + _ACROSS >= len(panels))


def _name_values(frame: "Axes", name: str) -> None:
    """The name of all panels' values at the left of the frame, of which nothing else is seen."""
    lines = wrapped(name, inches(frame).height + 0.3, LABEL)
    frame.set_ylabel("\n".join(lines), fontsize=LABEL, color=INK, labelpad=27)
    frame.set_xticks([])
    frame.set_yticks([])
    for spine in frame.spines.values():
        spine.set_visible(False)
