"""Every figure that the records in a folder allow, as PNG; nothing global, nothing on a screen.

Each one states below itself what it was made from. Colours and axes are `style`'s business.
"""

import io
import itertools
import json
import re
import textwrap
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from msgdrop_cli.analysis.curves import SMOOTHING_SHARE, Curve, learning_curve
from msgdrop_cli.analysis.metrics import Metric
from msgdrop_cli.analysis.summary import Arm, Group, Row, Summary
from msgdrop_cli.report.captions import footer, scale, spread_note
from msgdrop_cli.report.reference_lines import reference_lines
from msgdrop_cli.report.settings import own_settings
from msgdrop_cli.report.style import DPI, INK, QUIET, canvas, look, spread, tint
from msgdrop_cli.report.table import links_text
from msgdrop_cli.report.write import Folder, write_atomic

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MINIMUM_RATES = 3
"""Fewer dropout rates make no curve."""


def draw_all(summary: Summary, folder: Folder) -> list[Path]:
    """Draw what the done runs allow; the files are `<environment>-<profile>-<steps>-<kind>.png`.

    Raises RecordError: rows that cannot be read, a folder that cannot be written (73, 74).
    """
    kinds = {
        "learning": draw_learning,
        "dropout-rate": draw_dropout_rate,
        "broken-links": draw_broken_links,
    }
    paths = []
    with own_settings():
        for group in summary.groups:
            for kind, draw in kinds.items():
                figure = draw(summary, group)
                if figure is not None:
                    name = f"{_file_stem(group)}-{kind}.png"
                    paths.append(write_atomic(folder, name, _png(figure)))
    return paths


def draw_learning(summary: Summary, group: Group) -> "Figure | None":
    """The headline while training: each variant's mean over seeds, its band, its name beside."""
    metric = summary.metrics(group.environment).headline
    curves: list[tuple[Arm, Curve]] = []
    for arm in summary.arms_of(group):
        curve = learning_curve(arm.done, metric.name, bootstrap_seed=summary.bootstrap_seed)
        if curve is not None:
            curves.append((arm, curve))
    if not curves:
        return None
    values = [value for _, curve in curves for seed in curve.by_seed.values() for value in seed]
    lines = reference_lines(summary, group, metric, values)
    below = footer(
        summary,
        group,
        [arm for arm, _ in curves],
        f"{metric.label} = {metric.formula}; of the exploring policy, in windows of training, "
        f"centred moving mean over {SMOOTHING_SHARE:.0%} of the run. "
        + spread_note({len(curve.by_seed) for _, curve in curves}, "line", "band")
        + lines.note,
    )
    figure, axes = canvas(f"Learning, {scale(group)}", below, right=1.75)
    for arm, curve in curves:
        colour, line = look(arm.variant)
        axes.plot(curve.env_steps, curve.mean, color=colour, linestyle=line, linewidth=1.8)
        if curve.band:
            low, high = zip(*curve.band, strict=True)
            axes.fill_between(
                curve.env_steps,
                low,
                high,
                color=colour,
                alpha=0.16 if len(curves) < 6 else 0.1,
                linewidth=0,
            )
    _env_steps_axis(axes, group.train_env_steps)
    _measure_axis(axes, metric, values)
    ends = [(arm.label, curve.mean[-1], look(arm.variant).colour) for arm, curve in curves]
    _label_ends(axes, [*ends, *lines.draw(axes)])
    return figure


def draw_dropout_rate(summary: Summary, group: Group) -> "Figure | None":
    """The headline after training against the rate of message dropout; FDC apart, at the right."""
    metric = summary.metrics(group.environment).headline
    arms = [arm for arm in summary.arms_of(group) if arm.row(metric.name)]
    series = _dropout_series(arms)
    if len(series) < MINIMUM_RATES:
        return None
    rates = [rate for rate, _ in series]
    without = [arm for arm in arms if arm.setup["algorithm"].get("network") == "own"]
    step = min(after - before for before, after in itertools.pairwise(rates))
    apart = [rates[-1] + 1.5 * step * (rank + 1) for rank in range(len(without))]
    drawn = [arm for _, arm in series] + without
    rows = [row for arm in drawn if (row := arm.row(metric.name))]
    values = [value for row in rows for value in row.by_seed.values()]
    lines = reference_lines(summary, group, metric, values)
    below = footer(
        summary,
        group,
        drawn,
        f"{metric.label} = {metric.formula}; greedy evaluation after training. "
        + spread_note({len(row.by_seed) for row in rows}, "point", "bar")
        + " Small dots: seeds. Rate 0 is DCC."
        + lines.note,
    )
    figure, axes = canvas(f"After training, {scale(group)}", below, right=1.0)
    means = [row.mean for row in rows[: len(rates)]]
    axes.plot(rates, means, color="#BBBBBB", linewidth=1.2, zorder=1)
    for place, arm, row in zip(rates + apart, drawn, rows, strict=True):
        colour = look(arm.variant).colour
        _spread_marks(axes, place, row, colour, width=0.25 * step)
        axes.scatter([place], [row.mean], s=48, color=colour, zorder=4, edgecolor="white")
    axes.set_xticks(rates + apart, [f"{rate:g}" for rate in rates] + [arm.label for arm in without])
    axes.set_xlabel("rate of message dropout in training", fontsize=9.5, color=INK)
    _measure_axis(axes, metric, values)
    _label_ends(axes, lines.draw(axes))
    return figure


def draw_broken_links(summary: Summary, group: Group) -> "Figure | None":
    """The headline of each variant with growing shares of links broken, as bars side by side."""
    metric = summary.metrics(group.environment).headline
    arms = [arm for arm in summary.arms_of(group) if arm.rows]
    fractions = sorted({row.broken_links for arm in arms for row in arm.rows})
    if len(fractions) < 2:
        return None
    values = [
        value
        for arm in arms
        for row in arm.rows
        if row.metric == metric.name
        for value in row.by_seed.values()
    ]
    lines = reference_lines(summary, group, metric, values)
    below = footer(
        summary,
        group,
        arms,
        f"{metric.label} = {metric.formula}; greedy evaluation after training, "
        "the same policies with part of the links broken. "
        + spread_note({len(row.by_seed) for arm in arms for row in arm.rows}, "bar", "line")
        + " Dots: seeds."
        + lines.note,
    )
    width = max(7.5, 0.47 * len(arms) * len(fractions))
    figure, axes = canvas(f"Broken links, {scale(group)}", below, width=width, right=1.0)
    ticks, names = [], []
    for rank, arm in enumerate(arms):
        for column, fraction in enumerate(fractions):
            place = rank * (len(fractions) + 0.9) + column
            ticks.append(place)
            names.append(links_text(fraction))
            row = arm.row(metric.name, fraction)
            if row is None:
                continue
            colour = look(arm.variant).colour
            shade = tint(colour, 1.0 - 0.72 * column / (len(fractions) - 1))
            axes.bar(place, row.mean, 0.86, color=shade, edgecolor=colour, linewidth=0.8)
            _spread_marks(axes, place, row, INK, width=0.3)
        middle = rank * (len(fractions) + 0.9) + (len(fractions) - 1) / 2.0
        _name_below(axes, middle, arm.label)
    axes.set_xticks(ticks, names, fontsize=8, color=QUIET)
    axes.tick_params(axis="x", length=0)
    _measure_axis(axes, metric, values)
    _label_ends(axes, lines.draw(axes))
    return figure


def _dropout_series(arms: Sequence[Arm]) -> list[tuple[float, Arm]]:
    """The largest set of arms that differ in nothing but the rate of message dropout, by rate."""
    series: dict[str, dict[float, Arm]] = defaultdict(dict)
    for arm in arms:
        algorithm = dict(arm.setup["algorithm"])
        rate = algorithm.pop("rate", None)
        message_dropout = {"network": "fgh", "dropout": "message", "drops_own": False}
        if rate is not None and message_dropout.items() <= algorithm.items():
            key = json.dumps({**arm.setup, "algorithm": algorithm}, sort_keys=True)
            series[key].setdefault(float(rate), arm)
    largest = max(series.values(), key=lambda each: len(each)) if series else {}
    return [(rate, largest[rate]) for rate in sorted(largest)]


def _name_below(axes: "Axes", place: float, label: str) -> None:
    """A variant's name below the tick labels of its bars."""
    axes.annotate(
        textwrap.fill(label, 20),
        (place, 0),
        xycoords=("data", "axes fraction"),
        xytext=(0, -20),
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize=9.5,
        fontweight="bold",
        color=INK,
    )


def _spread_marks(axes: "Axes", place: float, row: Row, colour: str, width: float) -> None:
    """The interval as a line, and each seed as a small dot to the right of it."""
    seeds = len(row.by_seed)
    beside = [place + width * (0.3 + 0.7 * rank / max(1, seeds - 1)) for rank in range(seeds)]
    axes.scatter(
        beside, list(row.by_seed.values()), s=8, color=colour, alpha=0.6, linewidths=0, zorder=3
    )
    if row.interval:
        axes.vlines(place, *row.interval, color=colour, linewidth=1.6, zorder=3)


def _measure_axis(axes: "Axes", metric: Metric, values: Sequence[float]) -> None:
    """Name the metric; begin at 0 unless something lies below, for bars and rates are amounts."""
    better = "higher" if metric.higher_is_better else "lower"
    axes.set_ylabel(f"{metric.label} ({better} is better)", fontsize=9.5, color=INK)
    if min(values, default=0.0) >= 0.0:
        axes.set_ylim(bottom=0.0)


def _env_steps_axis(axes: "Axes", steps: int) -> None:
    unit, word = (1e6, "million ") if steps >= 1_000_000 else (1e3, "thousand ")
    axes.set_xlim(0, steps)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value / unit:g}")
    axes.set_xlabel(f"{word}env steps", fontsize=9.5, color=INK)


def _label_ends(axes: "Axes", ends: Sequence[tuple[str, float, str]]) -> None:
    """Write each (label, last value, colour) beside the axes at the line's end, none on another."""
    bottom, top = axes.get_ylim()
    heights = spread([(value - bottom) / (top - bottom) for _, value, _ in ends], gap=0.055)
    for (label, value, colour), height in zip(ends, heights, strict=True):
        end = (value - bottom) / (top - bottom)
        axes.plot(
            [1.0, 1.012, 1.028, 1.04],
            [end, end, height, height],
            color=colour,
            linewidth=1.2,
            transform=axes.transAxes,
            clip_on=False,
        )
        axes.text(
            1.05,
            height,
            textwrap.shorten(label, 26, placeholder="…"),
            transform=axes.transAxes,
            va="center",
            fontsize=9,
            color=INK,
        )


def _file_stem(group: Group) -> str:
    words = (group.environment, group.profile, str(group.train_env_steps))
    return "-".join(re.sub(r"[^A-Za-z0-9._-]", "_", word) for word in words).lstrip(".")


def _png(figure: "Figure") -> bytes:
    buffer = io.BytesIO()
    # Without matplotlib's version in it, the same records give the same bytes.
    figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()
