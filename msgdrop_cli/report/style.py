"""How figures look: the palette (Okabe and Ito's, safe for colour-blind readers), axes and footer.

A variant has one look in every figure, by its name alone, so that figures can be laid side by side.
"""

import re
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple
from zlib import crc32

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 150
INK = "#222222"
QUIET = "#666666"
_GREEN, _SKY, _PURPLE, _BLACK = "#009E73", "#56B4E9", "#CC79A7", "#000000"
_FAMILIES = (
    (r"fdc|ddpg", "#8A8A8A"),
    (r"dcc|maddpg", "#0072B2"),
    (r"vanilla-maddpg", _SKY),
    (r"full-md.*", _SKY),
    (r"full-sd.*", _BLACK),
    (r"sd-.*", _PURPLE),
    (r"(maddpg-)?md-0?\.1", "#F0C060"),
    (r"(maddpg-)?md-0?\.2", "#E69F00"),
    (r"(maddpg-)?md-0?\.3", "#D55E00"),
    (r"(maddpg-)?md-0?\.4", "#66C7AC"),
    (r"(maddpg-)?md-.*", _GREEN),
)
_OTHERS = (_GREEN, _SKY, _PURPLE, _BLACK)


class Look(NamedTuple):
    """Colour and line of a variant."""

    colour: str
    line: str


def look(variant: str) -> Look:
    """The look of a variant: colour by family (`md-0.2`), dashes for other networks (`concat-`)."""
    base = variant.lower().removeprefix("concat-").removeprefix("own-")
    line = "solid" if base == variant.lower() else "dashed"
    for pattern, colour in _FAMILIES:
        if re.fullmatch(pattern, base):
            return Look(colour, line)
    return Look(_OTHERS[crc32(base.encode()) % len(_OTHERS)], "dashdot")


def tint(colour: str, share: float) -> tuple[float, float, float]:
    """The colour mixed with white; share 1 is the colour itself, 0 is white."""
    channels = (int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    red, green, blue = (1.0 - share * (1.0 - channel) for channel in channels)
    return red, green, blue


def canvas(
    title: str, footer: str, *, width: float = 7.5, right: float = 0.3
) -> "tuple[Figure, Axes]":
    """An empty figure with its title, quiet axes, and the footer below.

    width: of the figure; right: free margin beside the axes; both in inches.
    """
    from matplotlib.figure import Figure

    lines = [line for part in footer.split("\n") for line in textwrap.wrap(part, int(width * 17.5))]
    height = 4.44 + 0.145 * len(lines)
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    bottom = 0.66 + 0.145 * len(lines)
    axes = figure.add_axes(
        (0.75 / width, bottom / height, 1.0 - (0.75 + right) / width, 1.0 - (bottom + 0.5) / height)
    )
    axes.set_title(title, loc="left", fontsize=11.5, color=INK, pad=10)
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


def spread(positions: Sequence[float], gap: float) -> list[float]:
    """Positions moved as little as needed so that neighbours are `gap` apart, order kept.

    Clusters of labels that would touch are laid out around their common middle.
    """
    ranks = sorted(range(len(positions)), key=lambda rank: positions[rank])
    clusters: list[list[int]] = []
    for rank in ranks:
        clusters.append([rank])
        while len(clusters) > 1 and (
            _start(clusters[-1], positions, gap)
            < _start(clusters[-2], positions, gap) + gap * len(clusters[-2])
        ):
            last = clusters.pop()
            clusters[-1] += last
    placed = list(positions)
    for cluster in clusters:
        start = _start(cluster, positions, gap)
        for offset, rank in enumerate(cluster):
            placed[rank] = start + gap * offset
    return placed


def _start(cluster: Sequence[int], positions: Sequence[float], gap: float) -> float:
    """The lowest place of a cluster that is centred on its members' mean."""
    middle = sum(positions[rank] for rank in cluster) / len(cluster)
    return middle - gap * (len(cluster) - 1) / 2.0
