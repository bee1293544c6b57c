"""Every figure that the records in a folder allow; nothing global, nothing on a screen.

Each one states below itself what it was made from. Colours and axes are `style`'s business, files
are `drawn`'s.
"""

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from msgdrop_cli.analysis.curves import SMOOTHING_SHARE, Curve, learning_curve
from msgdrop_cli.analysis.differences import pairs_of, shipped_claims
from msgdrop_cli.analysis.statistics import total
from msgdrop_cli.analysis.summary import Group, Summary
from msgdrop_cli.definition.channel import only_links
from msgdrop_cli.definition.spec import Claim
from msgdrop_cli.report.bars import draw_channels
from msgdrop_cli.report.captions import footer, scale, spread_note
from msgdrop_cli.report.differences import draw_differences
from msgdrop_cli.report.drawn import SUFFIXES, Drawn, curve_rows
from msgdrop_cli.report.learning_differences import draw_learning_differences
from msgdrop_cli.report.looks import Look, Shown, shown_arms
from msgdrop_cli.report.marks import end, env_steps_axis, label_ends, measure_axis
from msgdrop_cli.report.matrix import draw_matrix
from msgdrop_cli.report.rates import draw_dropout_rate
from msgdrop_cli.report.reference_lines import reference_lines
from msgdrop_cli.report.settings import own_settings
from msgdrop_cli.report.style import AXES, Size, canvas
from msgdrop_cli.report.write import Folder

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDTH, _RIGHT = AXES.width - 0.65, 1.65
"""Inches of the axes of learning curves, and beside them, where the names stand."""
_MARKS = 7
"""Marks on a curve, about, so that it is known in grey, too."""


def draw_all(
    summary: Summary,
    folder: Folder,
    claims: Sequence[Claim] | None = None,
    suffixes: Sequence[str] = SUFFIXES,
    wanted: Callable[[str], bool] = bool,
) -> list[Path]:
    """Draw what the done runs allow; the files are `<environment>-<profile>-<steps>-<kind>.png`.

    Beside each lie the same as .pdf and .svg, and its numbers as .csv, or what `suffixes` asks for.
    claims: whose differences are drawn; None: those of the shipped questions that these runs were
    trained for. wanted: of a figure's name, whether it is drawn; all are. Returns the paths, figure
    by figure.
    Raises RecordError: rows that cannot be read, a folder that cannot be written (73, 74).
    """
    claims = shipped_claims(summary) if claims is None else claims
    paths = []
    with own_settings():
        for group in summary.groups:
            pairs = pairs_of(summary, group, claims)
            kinds: dict[str, Callable[[Summary, Group], Drawn | None]] = {
                "learning": draw_learning,
                "learning-differences": partial(draw_learning_differences, pairs=pairs),
                "dropout-rate": draw_dropout_rate,
                _channels_of(summary, group): draw_channels,
                "matrix": draw_matrix,
                "differences": partial(draw_differences, pairs=pairs),
            }
            names = {f"{file_stem(group)}-{kind}": draw for kind, draw in kinds.items()}
            for name in filter(wanted, names):
                drawn = names[name](summary, group)
                if drawn is not None:
                    paths += drawn.write(folder, name, suffixes)
    return paths


def _channels_of(summary: Summary, group: Group) -> str:
    """What bars side by side are called: the paper's test, or whatever else messages go through."""
    rows = (row for arm in summary.arms_of(group) for row in arm.rows)
    return "broken-links" if only_links(row.channel for row in rows) else "channels"


def draw_learning(summary: Summary, group: Group) -> Drawn | None:
    """The headline while training: each variant's mean over seeds, its band, its name beside."""
    metric = summary.metrics(group.environment).headline
    curves: list[tuple[Shown, Curve]] = []
    for each in shown_arms(summary, group):
        curve = learning_curve(each.arm.done, metric.name)
        if curve is not None:
            curves.append((each, curve))
    if not curves:
        return None
    values = [value for _, curve in curves for seed in curve.by_seed.values() for value in seed]
    lines = reference_lines(summary, group, metric, values)
    below = footer(
        summary,
        group,
        [each.arm for each, _ in curves],
        f"{metric.label} = {metric.formula}; of the exploring policy, in windows of training, "
        f"centred moving mean over {SMOOTHING_SHARE:.0%} of the run. "
        + spread_note({len(curve.by_seed) for _, curve in curves}, "line", "band")
        + lines.note,
    )
    ends = [
        end(label, curve.mean[-1], look.colour, look.marker) for (_, label, look), curve in curves
    ]
    ends += lines.ends
    size = Size(_WIDTH, max(AXES.height, total(each.height for each in ends)))
    figure, axes = canvas(f"Learning, {scale(group)}", below, size=size, right=_RIGHT)
    for rank, (each, curve) in enumerate(curves):
        _draw_curve(axes, curve, each.look, rank / len(curves), shade=_shade(len(curves)))
    env_steps_axis(axes, group.train_env_steps)
    measure_axis(axes, metric, values)
    lines.draw(axes)
    label_ends(axes, ends)
    return Drawn(
        figure=figure,
        group=group,
        arms=[each.arm for each, _ in curves],
        columns=("variant", "label", "env_steps", "value", "low", "high"),
        rows=[
            *((a.arm.variant, a.label, *row) for a, curve in curves for row in curve_rows(curve)),
            *((None, label, None, height, None, None) for label, height in lines.shown.items()),
        ],
    )


def _shade(curves: int) -> float:
    """How dark a band may be so that all of them together leave the lines visible."""
    return 0.16 if curves < 6 else 0.1 if curves < 9 else 0.05


def _draw_curve(axes: "Axes", curve: Curve, look: Look, phase: float, *, shade: float) -> None:
    """Mean and band; the marks begin at this share of their distance, so that curves' differ."""
    every = max(1, len(curve.mean) // _MARKS)
    axes.plot(
        curve.env_steps,
        curve.mean,
        color=look.colour,
        linestyle=look.line,
        linewidth=1.6,
        marker=look.marker,
        markevery=(int(phase * every), every),
        markersize=5.0,
        markeredgecolor="white",
        markeredgewidth=0.5,
    )
    if curve.band:
        low, high = zip(*curve.band, strict=True)
        axes.fill_between(curve.env_steps, low, high, color=look.colour, alpha=shade, linewidth=0)


def file_stem(group: Group) -> str:
    """How the names of a group's files begin."""
    words = (group.environment, group.profile, str(group.train_env_steps))
    return "-".join(re.sub(r"[^A-Za-z0-9._-]", "_", word) for word in words).lstrip(".")
