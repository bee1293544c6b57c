"""Which colour, line and marker stands for whom: also in grey, and the same in every figure.

The variants that everybody has are known by their names (colours by Okabe and Ito, safe for
colour-blind readers); those of somebody's own question share a second palette (after Tol).
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple
from zlib import crc32

from msgdrop_cli.analysis.summary import Arm, Group, Summary
from msgdrop_cli.report.lettering import UNKNOWN, drawable_name

_FAMILIES = (
    (r"fdc|ddpg", "#474747", "o"),
    (r"dcc|maddpg", "#0072B2", "s"),
    (r"vanilla-maddpg", "#56B4E9", "d"),
    (r"full-md.*", "#56B4E9", "v"),
    (r"full-sd.*", "#000000", "P"),
    (r"sd-.*", "#CC79A7", "X"),
    (r"(maddpg-)?md-0?\.1", "#F0C060", "<"),
    (r"(maddpg-)?md-0?\.2", "#E69F00", "^"),
    (r"(maddpg-)?md-0?\.3", "#D55E00", ">"),
    (r"(maddpg-)?md-0?\.4", "#66C7AC", "p"),
    (r"(maddpg-)?md-.*", "#009E73", "D"),
)
_COLOURS = (
    *("#332288", "#CC6677", "#117733", "#AA4499"),
    *("#999933", "#882255", "#44AA99", "#8C510A"),
)
_MARKERS = ("o", "s", "^", "D", "v", "X", "P", "p")
_OTHER_NETWORKS = re.compile(r"^(concat-|own-)")

Line = str | tuple[float, tuple[float, ...]]
_KNOWN_LINES: tuple[Line, ...] = ("solid", "dashed")
_LINES: tuple[Line, ...] = ("dashdot", (0.0, (9.0, 2.0)), (0.0, (5.0, 1.5, 1.0, 1.5, 1.0, 1.5)))
"""Of variants of one's own: no line that a known one may have."""


class Look(NamedTuple):
    """Colour, line and marker of a variant."""

    colour: str
    line: Line
    marker: str


class Shown(NamedTuple):
    """An arm as figures show it."""

    arm: Arm
    label: str
    """Drawable, and different from the labels of the others."""
    look: Look


def shown_arms(summary: Summary, group: Group) -> list[Shown]:
    """The arms of a group in their order.

    A label that the font cannot draw as it is, or that two variants have, begins with the
    variant's name.
    """
    arms = summary.arms_of(group)
    labels = [drawable_name(arm.label) for arm in arms]
    times = Counter(labels)
    for rank, arm in enumerate(arms):
        replaced = labels[rank].count(UNKNOWN) != arm.label.count(UNKNOWN)
        if replaced or times[labels[rank]] > 1:
            labels[rank] = f"{arm.variant}: {labels[rank]}"
    return list(map(Shown, arms, labels, looks([arm.variant for arm in arms])))


def looks(variants: Sequence[str]) -> list[Look]:
    """A look for each arm of a group, no two with the same line and marker (up to two dozen).

    It goes by the variant's name. Where two would look the same, as two set-ups of one variant do,
    the second (by name, known variants first) takes the next one that is free.
    """
    chosen: dict[int, Look] = {}
    for rank in sorted(range(len(variants)), key=lambda each: _precedence(variants, each)):
        taken = chosen.values()
        grey = {look[1:] for look in taken}
        options = list(_options(variants[rank]))
        free = [look for look in options if look[1:] not in grey]
        free = free or [look for look in options if look not in taken]
        chosen[rank] = (free or options)[0]
    return [chosen[rank] for rank in range(len(variants))]


def _precedence(variants: Sequence[str], rank: int) -> tuple[int, bool, str]:
    """First one arm of every variant, so that another set-up takes no variant's own look."""
    variant = variants[rank]
    return variants[:rank].count(variant), _family(variant) is None, variant


def _family(variant: str) -> tuple[str, str] | None:
    """Colour and marker of a variant that everybody has."""
    base = _base(variant)
    return next((each[1:] for each in _FAMILIES if re.fullmatch(each[0], base)), None)


def _base(variant: str) -> str:
    """The variant without what says that its network is another one."""
    return _OTHER_NETWORKS.sub("", variant.lower(), count=1)


def _options(variant: str) -> Iterator[Look]:
    """The looks that a variant may have, its own one first."""
    family = _family(variant)
    if family is not None:
        colour, own = family
        lines = _KNOWN_LINES if _base(variant) == variant.lower() else _KNOWN_LINES[::-1]
        markers = (own, *(each for each in _MARKERS if each != own))
        yield from (Look(colour, line, marker) for marker in markers for line in lines)
        return
    first = crc32(variant.lower().encode())
    for others, dashes, rank in product(*map(range, map(len, (_MARKERS, _LINES, _COLOURS)))):
        place = (first + rank) % len(_COLOURS)
        yield Look(
            _COLOURS[place],
            _LINES[(place + dashes) % len(_LINES)],
            _MARKERS[(place + others) % len(_MARKERS)],
        )
