"""A figure and the numbers in it, as files: PNG, PDF, SVG and CSV.

The same records give the same bytes, in any process: no date, no random id. Which runs a picture
shows and which matplotlib drew it stand in its metadata.
"""

import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgdrop_cli.analysis.curves import Curve
from msgdrop_cli.analysis.statistics import Interval
from msgdrop_cli.analysis.summary import Arm, Group, Row
from msgdrop_cli.report.cells import csv_bytes
from msgdrop_cli.report.looks import Shown
from msgdrop_cli.report.style import DPI
from msgdrop_cli.report.write import Folder, write_atomic

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

SUFFIXES = ("png", "pdf", "svg", "csv")
"""Of one figure's files: pictures for screens and for print, and the numbers."""
_ARM = ("variant", "label")
_SPREAD = ("seed", "value", "low", "high")
_PAPER = 0.08
"""Inches left free around whatever stands outside of the usual margins."""
_MOST_PIXELS = 30_000
"""In width or height; a figure that would be larger is drawn more coarsely."""


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A figure with what it shows."""

    figure: "Figure"
    group: Group
    arms: Sequence[Arm]
    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    """A line of the CSV each, in the order of the columns."""

    @property
    def run_ids(self) -> list[str]:
        """Of all runs whose numbers are in the figure, sorted."""
        return sorted({record.run_id for arm in self.arms for record in arm.done})

    def numbers(self) -> bytes:
        """What is drawn, as CSV; every line says of which runs it is."""
        columns = (*Group._fields, *self.columns)
        return csv_bytes(columns, [(*self.group, *row) for row in self.rows])

    def write(self, folder: Folder, stem: str, suffixes: Sequence[str] = SUFFIXES) -> list[Path]:
        """Write its files, those with these suffixes; RecordError (73, 74) if they cannot be."""
        files = {each: self.numbers() if each == "csv" else self.picture(each) for each in suffixes}
        return [write_atomic(folder, f"{stem}.{each}", files[each]) for each in files]

    def picture(self, suffix: str) -> bytes:
        """The figure on its paper, or on as much more as long names or large numbers ask for."""
        usual, whole = self.figure.bbox_inches, self._whole
        larger = whole.width > usual.width or whole.height > usual.height
        buffer = io.BytesIO()
        self.figure.savefig(
            buffer,
            format=suffix,
            dpi=min(DPI, _MOST_PIXELS / max(whole.width, whole.height)),
            bbox_inches=whole if larger else None,
            metadata=self._metadata(suffix),
        )
        return buffer.getvalue()

    @cached_property  # every format has the same, and finding it takes as long as drawing
    def _whole(self) -> "Bbox":
        """The usual paper and whatever stands outside of it, in inches."""
        from matplotlib.transforms import Bbox

        return Bbox.union([self.figure.bbox_inches, self.figure.get_tightbbox().padded(_PAPER)])

    def _metadata(self, suffix: str) -> dict[str, Any]:
        """What the picture is made from, under the names of its format, and no date."""
        import matplotlib

        title = " ".join(self.figure.axes[0].get_title(loc="left").split())
        runs = f"msgdrop runs: {' '.join(self.run_ids)}"
        tool = f"matplotlib {matplotlib.__version__}"
        by_format: dict[str, dict[str, Any]] = {
            "png": {"Software": tool, "Title": title, "Description": runs},
            "pdf": {"Creator": tool, "Title": title, "Keywords": runs, "CreationDate": None},
            "svg": {"Creator": tool, "Title": title, "Keywords": [runs], "Date": None},
        }
        return by_format[suffix]


def spread_columns(*where: str) -> tuple[str, ...]:
    """Names of the columns that `spread_rows` fills."""
    return (*_ARM, *where, *_SPREAD)


def spread_rows(shown: Shown, row: Row, *where: Any) -> Iterator[Sequence[Any]]:
    """The mean of an arm with its interval, then each seed; where: its place in the figure."""
    about = (shown.arm.variant, shown.label, *where)
    yield (*about, None, row.mean, *ends(row.interval))
    yield from ((*about, seed, value, None, None) for seed, value in row.by_seed.items())


def channel_rows(arms: Iterable[Shown], metric: str) -> Iterator[Sequence[Any]]:
    """The same of each arm through every channel that it was evaluated through."""
    for shown in arms:
        for row in shown.arm.rows:
            if row.metric == metric:
                yield from spread_rows(shown, row, row.channel.key)


def curve_rows(curve: Curve) -> Iterator[Sequence[Any]]:
    """Env steps, mean, low and high of a curve, point by point."""
    bands = list(map(ends, curve.band)) if curve.band else [ends(None)] * len(curve.mean)
    for step, value, band in zip(curve.env_steps, curve.mean, bands, strict=True):
        yield (step, value, *band)


def line_rows(lines: Iterable[tuple[str, float]], places: int) -> list[Sequence[Any]]:
    """The same for reference lines, which stand nowhere and have no seeds."""
    nothing = (None,) * places
    return [(None, label, *nothing, None, value, None, None) for label, value in lines]


def ends(interval: Interval | None) -> Sequence[float | None]:
    """Low and high; of no interval nothing."""
    return interval or (None, None)
