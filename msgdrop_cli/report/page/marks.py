"""A difference with its interval against zero and the margin of level, as a small drawing."""

from collections.abc import Iterable
from dataclasses import dataclass

from msgdrop_cli.analysis.intervals import FEWEST
from msgdrop_cli.analysis.reproduction import Line, Reading
from msgdrop_cli.report.page.content import interval, number
from msgdrop_cli.report.page.elements import Html, el, join

_WIDTH, _HEIGHT, _EDGE = 168.0, 22.0, 5.0


@dataclass(frozen=True, slots=True)
class Axis:
    """The range that differences of one kind are drawn on, zero included."""

    low: float
    high: float

    def at(self, value: float) -> float:
        """Where a value lies, in the drawing's units."""
        share = (value - self.low) / (self.high - self.low)
        return round(_EDGE + share * (_WIDTH - 2 * _EDGE), 1)


def axes_of(lines: Iterable[Line]) -> dict[tuple[str, str, str], Axis]:
    """One axis for all that can be compared: by game, metric and measure."""
    values: dict[tuple[str, str, str], list[float]] = {}
    for line in lines:
        if (reading := line.shown) and reading.difference is not None:
            ends = (reading.difference, reading.low, reading.high)
            found = values.setdefault(axis_key(line), [0.0])
            found += [end for end in ends if end is not None]
            if reading.margin is not None:
                found += [-reading.margin, reading.margin]
    return {
        key: Axis(min(found), max(found))
        for key, found in values.items()
        if min(found) < max(found)
    }


def axis_key(line: Line) -> tuple[str, str, str]:
    """What a difference can be compared with."""
    return line.environment, line.metric, line.measure


def drawn(reading: Reading, axis: Axis | None) -> Html:
    """A dot and a line; dashed where it is lowest to highest. Nothing without a difference."""
    if reading.difference is None or axis is None:
        return Html("")
    middle = _HEIGHT / 2
    parts = []
    if reading.margin is not None:
        left, right = axis.at(-reading.margin), axis.at(reading.margin)
        parts.append(
            el("rect", class_="margin", x=str(left), y="1", width=f"{right - left:.1f}",
               height=f"{_HEIGHT - 2:g}")
        )  # fmt: skip
    zero = str(axis.at(0.0))
    parts.append(el("line", class_="zero", x1=zero, x2=zero, y1="0", y2=f"{_HEIGHT:g}"))
    if reading.low is not None and reading.high is not None:
        few = "range" if reading.seeds < FEWEST else "interval"
        ends = {"x1": str(axis.at(reading.low)), "x2": str(axis.at(reading.high))}
        parts.append(el("line", class_=few, **ends, y1=f"{middle:g}", y2=f"{middle:g}"))
    dot = str(axis.at(reading.difference))
    parts.append(el("circle", class_="dot", cx=dot, cy=f"{middle:g}", r="4"))
    said = f"difference {number(reading.difference)} {interval(reading)}".strip()
    box = f"0 0 {_WIDTH:g} {_HEIGHT:g}"
    size = {"width": f"{_WIDTH:g}", "height": f"{_HEIGHT:g}"}
    return el("svg", join(*parts), viewBox=box, role="img", aria_label=said, **size)
