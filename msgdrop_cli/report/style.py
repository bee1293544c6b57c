"""How figures look: paper, ink, axes and footer. Looks of variants are in `looks`."""

from typing import TYPE_CHECKING, NamedTuple

from msgdrop_cli.report.lettering import LINE, wrapped

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 200
"""Of PNG, for screens; print takes PDF or SVG."""
ONE_COLUMN, TWO_COLUMNS = 3.25, 6.75
"""Inches of a printed figure; one with many names or bars is as wide as they need."""
LABEL, TICK, SMALL = 8.5, 8.0, 6.5
"""Letters of axes, of their ticks and of what stands below, in points, as they are printed."""
INK = "#222222"
QUIET = "#666666"
_TITLE = 10.0
_FOOTER_LINE = 0.13
_LEFT, _BELOW, _ABOVE = 0.75, 0.6, 0.45
"""Margins of the axes: for the ticks, for ticks and their name, for the title."""


class Size(NamedTuple):
    """Width and height in inches."""

    width: float
    height: float


AXES = Size(TWO_COLUMNS - _LEFT - 1.0, 2.95)
"""What axes measure if nothing asks for more."""


def tint(colour: str, share: float) -> tuple[float, float, float]:
    """The colour mixed with white; share 1 is the colour itself, 0 is white."""
    channels = (int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    red, green, blue = (1.0 - share * (1.0 - channel) for channel in channels)
    return red, green, blue


def canvas(
    title: str,
    footer: str,
    *,
    size: Size = AXES,
    left: float = _LEFT,
    right: float = 1.0,
    below: float = 0.0,
    above: float = 0.0,
) -> "tuple[Figure, Axes]":
    """An empty figure with its title, quiet axes of this size, and the footer below.

    left, right, below, above: free margins, in inches, beside the axes, below the names of their
    ticks, and between axes and title.
    """
    from matplotlib.figure import Figure

    width = left + size.width + right
    start = left if left == _LEFT else 0.12
    heading = wrapped(title, width - start - 0.12, _TITLE)
    lines = [line for part in footer.split("\n") for line in wrapped(part, width - 0.3, SMALL)]
    bottom = _BELOW + below + _FOOTER_LINE * len(lines)
    height = bottom + size.height + above + _ABOVE + (len(heading) - 1) * _TITLE * LINE
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    axes = quiet_axes(
        figure.add_axes((left / width, bottom / height, size.width / width, size.height / height))
    )
    axes.set_title(
        "\n".join(heading), loc="left", fontsize=_TITLE, color=INK, pad=8 + 72 * above,
        x=(start - left) / size.width,
    )  # fmt: skip
    figure.text(
        0.12 / width,
        0.1 / height,
        "\n".join(lines),
        fontsize=SMALL,
        color=QUIET,
        va="bottom",
        linespacing=1.35,
    )
    return figure, axes


def quiet_axes(axes: "Axes") -> "Axes":
    """Axes without a frame, whose lines stand behind what they carry."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color("#999999")
    axes.tick_params(colors=INK, labelsize=TICK, color="#999999")
    axes.grid(axis="y", color="#E6E6E6", linewidth=0.8)
    axes.set_axisbelow(True)
    return axes


def inches(axes: "Axes") -> Size:
    """The size of the axes."""
    box, dpi = axes.get_window_extent(), axes.figure.dpi
    return Size(box.width / dpi, box.height / dpi)
