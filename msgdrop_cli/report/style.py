"""How figures look: paper, ink, axes and footer. Looks of variants are in `looks`."""

import textwrap
from typing import TYPE_CHECKING, NamedTuple

from msgdrop_cli.report.lettering import drawable, wrapped

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 150
INK = "#222222"
QUIET = "#666666"
_TITLE = 11.5
_FOOTER_LINE = 0.145
_LEFT, _BELOW, _ABOVE = 0.75, 0.66, 0.5
"""Margins of the axes: for the ticks, for ticks and their name, for the title."""


class Size(NamedTuple):
    """Width and height in inches."""

    width: float
    height: float


AXES = Size(5.75, 3.28)
"""What axes measure if nothing asks for more."""


def tint(colour: str, share: float) -> tuple[float, float, float]:
    """The colour mixed with white; share 1 is the colour itself, 0 is white."""
    channels = (int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    red, green, blue = (1.0 - share * (1.0 - channel) for channel in channels)
    return red, green, blue


def canvas(
    title: str, footer: str, *, size: Size = AXES, right: float = 1.0, below: float = 0.0
) -> "tuple[Figure, Axes]":
    """An empty figure with its title, quiet axes of this size, and the footer below.

    right, below: free margins, in inches, beside the axes and below the names of their ticks.
    """
    from matplotlib.figure import Figure

    width = _LEFT + size.width + right
    lines = [
        line
        for part in footer.split("\n")
        for line in textwrap.wrap(drawable(part), int(width * 17.5))
    ]
    bottom = _BELOW + below + _FOOTER_LINE * len(lines)
    height = bottom + size.height + _ABOVE
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    axes = figure.add_axes(
        (_LEFT / width, bottom / height, size.width / width, size.height / height)
    )
    heading = wrapped(drawable(title), size.width + right, _TITLE)
    axes.set_title("\n".join(heading), loc="left", fontsize=_TITLE, color=INK, pad=10)
    figure.text(
        0.12 / width,
        0.1 / height,
        "\n".join(lines),
        fontsize=7,
        color=QUIET,
        va="bottom",
        linespacing=1.35,
    )
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color("#999999")
    axes.tick_params(colors=INK, labelsize=9, color="#999999")
    axes.grid(axis="y", color="#E6E6E6", linewidth=0.8)
    axes.set_axisbelow(True)
    return figure, axes


def inches(axes: "Axes") -> Size:
    """The size of the axes."""
    box, dpi = axes.get_window_extent(), axes.figure.dpi
    return Size(box.width / dpi, box.height / dpi)
