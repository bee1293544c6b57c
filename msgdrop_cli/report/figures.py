"""Every figure that the records in a folder allow, as PNG; nothing global, nothing on a screen.

Each one states below itself what it was made from. Colours and axes are `style`'s business.
"""

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

from msgdrop_cli.analysis.curves import SMOOTHING_SHARE, Curve, learning_curve
from msgdrop_cli.analysis.summary import Group, Summary
from msgdrop_cli.report.bars import draw_channels
from msgdrop_cli.report.captions import footer, scale, spread_note
from msgdrop_cli.report.looks import Look, Shown, shown_arms
from msgdrop_cli.report.marks import end, label_ends, measure_axis
from msgdrop_cli.report.matrix import draw_matrix
from msgdrop_cli.report.rates import draw_dropout_rate
from msgdrop_cli.report.reference_lines import reference_lines
from msgdrop_cli.report.settings import own_settings
from msgdrop_cli.report.style import AXES, DPI, INK, Size, canvas
from msgdrop_cli.report.write import Folder, write_atomic

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH, _RIGHT = 5.0, 1.75
"""Inches of the axes of learning curves, and beside them, where the names stand."""
_MARKS = 7
"""Marks on a curve, about, so that it is known in grey, too."""
_PAPER = 0.08
"""Inches left free around whatever stands outside of the usual margins."""
_MOST_PIXELS = 30_000
"""In width or height; a figure that would be larger is drawn more coarsely."""


def draw_all(summary: Summary, folder: Folder) -> list[Path]:
    """Draw what the done runs allow; the files are `<environment>-<profile>-<steps>-<kind>.png`.

    Raises RecordError: rows that cannot be read, a folder that cannot be written (73, 74).
    """
    kinds = {
        "learning": draw_learning,
        "dropout-rate": draw_dropout_rate,
        "broken-links": draw_channels,
        "matrix": draw_matrix,
    }
    paths = []
    with own_settings():
        for group in summary.groups:
            for kind, draw in kinds.items():
                figure = draw(summary, group)
                if figure is not None:
                    name = f"{file_stem(group)}-{kind}.png"
                    paths.append(write_atomic(folder, name, png(figure)))
    return paths


def draw_learning(summary: Summary, group: Group) -> "Figure | None":
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
    size = Size(_WIDTH, max(AXES.height, sum(each.height for each in ends)))
    figure, axes = canvas(f"Learning, {scale(group)}", below, size=size, right=_RIGHT)
    for rank, (each, curve) in enumerate(curves):
        _draw_curve(axes, curve, each.look, rank / len(curves), shade=_shade(len(curves)))
    _env_steps_axis(axes, group.train_env_steps)
    measure_axis(axes, metric, values)
    lines.draw(axes)
    label_ends(axes, ends)
    return figure


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
        linewidth=1.8,
        marker=look.marker,
        markevery=(int(phase * every), every),
        markersize=5.0,
        markeredgecolor="white",
        markeredgewidth=0.5,
    )
    if curve.band:
        low, high = zip(*curve.band, strict=True)
        axes.fill_between(curve.env_steps, low, high, color=look.colour, alpha=shade, linewidth=0)


def _env_steps_axis(axes: "Axes", steps: int) -> None:
    unit, word = (1e6, "million ") if steps >= 1_000_000 else (1e3, "thousand ")
    axes.set_xlim(0, steps)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value / unit:g}")
    axes.set_xlabel(f"{word}env steps", fontsize=9.5, color=INK)


def file_stem(group: Group) -> str:
    """How the names of a group's files begin."""
    words = (group.environment, group.profile, str(group.train_env_steps))
    return "-".join(re.sub(r"[^A-Za-z0-9._-]", "_", word) for word in words).lstrip(".")


def png(figure: "Figure") -> bytes:
    """The figure on its paper, or on as much more as long names or large numbers ask for."""
    from matplotlib.transforms import Bbox

    usual = figure.bbox_inches
    whole = Bbox.union([usual, figure.get_tightbbox().padded(_PAPER)])
    larger = whole.width > usual.width or whole.height > usual.height
    buffer = io.BytesIO()
    figure.savefig(
        buffer,
        format="png",
        dpi=min(DPI, _MOST_PIXELS / max(whole.width, whole.height)),
        bbox_inches=whole if larger else None,
        # Without matplotlib's version in it, the same records give the same bytes.
        metadata={"Software": None},
    )
    return buffer.getvalue()
