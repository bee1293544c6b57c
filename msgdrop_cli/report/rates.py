"""What each rate of message dropout comes to after training, as a curve over the rates."""

import itertools
import json
import math
from collections import defaultdict
from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

from msgdrop_cli.analysis.summary import Group, Summary
from msgdrop_cli.report.captions import footer, scale, spread_note
from msgdrop_cli.report.drawn import Drawn, line_rows, spread_columns, spread_rows
from msgdrop_cli.report.lettering import LINE, width, wrapped
from msgdrop_cli.report.looks import Shown, shown_arms
from msgdrop_cli.report.marks import label_ends, measure_axis, spread_marks
from msgdrop_cli.report.reference_lines import reference_lines
from msgdrop_cli.report.style import AXES, INK, LABEL, TICK, Size, canvas

MINIMUM_RATES = 3
"""Fewer dropout rates make no curve."""
_WIDEST, _ROOM = 1.15, 0.1
"""Names below the axis: inches of a line, inches to the next name."""


def draw_dropout_rate(summary: Summary, group: Group) -> Drawn | None:
    """The headline after training against the rate of message dropout; FDC apart, at the right."""
    metric = summary.metrics(group.environment).headline
    shown = [each for each in shown_arms(summary, group) if each.arm.row(metric.name)]
    series = _dropout_series(shown)
    if len(series) < MINIMUM_RATES:
        return None
    rates = [rate for rate, _ in series]
    without = [each for each in shown if each.arm.setup["algorithm"].get("network") == "own"]
    drawn = [each for _, each in series] + without
    rows = [row for each in drawn if (row := each.arm.row(metric.name))]
    values = [value for row in rows for value in row.by_seed.values()]
    lines = reference_lines(summary, group, metric, values)
    below = footer(
        summary,
        group,
        [each.arm for each in drawn],
        f"{metric.label} = {metric.formula}; greedy evaluation after training. "
        + spread_note({len(row.by_seed) for row in rows}, "point", "bar")
        + " Small dots: seeds. Rate 0 is DCC."
        + lines.note,
    )
    names = [wrapped(each.label, _WIDEST, TICK) for each in without]
    apart, wide, unit = _places(rates, names)
    figure, axes = canvas(
        f"After training, {scale(group)}",
        below,
        size=Size(wide, AXES.height),
        below=(max(map(len, names), default=1) - 1) * TICK * LINE,
    )
    means = [row.mean for row in rows[: len(rates)]]
    axes.plot(rates, means, color="#BBBBBB", linewidth=1.2, zorder=1)
    for place, (_, _, look), row in zip(rates + apart, drawn, rows, strict=True):
        spread_marks(axes, place, row, look.colour, width=0.25 * _step(rates))
        axes.scatter([place], [row.mean], s=48, color=look.colour, zorder=4, edgecolor="white")
    axes.set_xticks(rates + apart, [*_rate_names(rates, unit), *map("\n".join, names)])
    axes.set_xlabel("rate of message dropout in training", fontsize=LABEL, color=INK)
    measure_axis(axes, metric, values)
    lines.draw(axes)
    label_ends(axes, lines.ends)
    where = [*rates, *[None] * len(without)]
    seeds = map(spread_rows, drawn, rows, where)
    return Drawn(
        figure=figure,
        group=group,
        arms=[each.arm for each in drawn],
        columns=spread_columns("rate"),
        rows=[*chain.from_iterable(seeds), *line_rows(lines.shown.items(), 1)],
    )


def _dropout_series(shown: Sequence[Shown]) -> list[tuple[float, Shown]]:
    """The largest set of arms that differ in nothing but the rate of message dropout, by rate."""
    series: dict[str, dict[float, Shown]] = defaultdict(dict)
    for each in shown:
        algorithm = dict(each.arm.setup["algorithm"])
        rate = algorithm.pop("rate", None)
        is_rate = type(rate) in (int, float) and 0.0 <= rate <= 1.0  # it is perhaps a stranger's
        message_dropout = {"network": "fgh", "dropout": "message", "drops_own": False}
        if is_rate and message_dropout.items() <= algorithm.items():
            key = json.dumps({**each.arm.setup, "algorithm": algorithm}, sort_keys=True)
            series[key].setdefault(float(rate), each)
    largest = max(series.values(), key=lambda each: len(each)) if series else {}
    return [(rate, largest[rate]) for rate in sorted(largest)]


def _step(rates: Sequence[float]) -> float:
    """The smallest distance between two rates."""
    return min(after - before for before, after in itertools.pairwise(rates))


class _Places(NamedTuple):
    """The axis of rates with those apart at its end."""

    apart: list[float]
    """Where those without a rate stand."""
    width: float
    """Of the axes, in inches."""
    unit: float
    """Rate of an inch."""


def _places(rates: Sequence[float], names: Sequence[Sequence[str]]) -> _Places:
    """The usual axes, or wider ones if the names of those apart need it."""
    usual = 1.5 * _step(rates)
    span = 1.1 * (rates[-1] + len(names) * usual - rates[0])  # with matplotlib's margins of 5%
    unit = span / AXES.width
    widest = max((width(line, TICK) for name in names for line in name), default=0.0)
    distance = max(usual, (widest + _ROOM) * unit)
    return _Places(
        apart=[rates[-1] + distance * (rank + 1) for rank in range(len(names))],
        width=AXES.width + 1.1 * len(names) * (distance - usual) / unit,
        unit=unit,
    )


def _rate_names(rates: Sequence[float], unit: float) -> list[str]:
    """Each rate in figures, or nothing where they would stand on the ones before."""
    names, free = [], -math.inf
    for rate in rates:
        name = f"{rate:g}"
        half = unit * (width(name, TICK) + _ROOM / 2.0) / 2.0
        fits = rate - half >= free
        names.append(name if fits else "")
        free = rate + half if fits else free
    return names
