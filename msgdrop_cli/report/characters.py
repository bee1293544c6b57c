"""A frame of an episode in characters, for terminals: who is where, and who cannot hear whom."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from operator import itemgetter
from typing import Any, NamedTuple

_WORKS, _BROKEN, _POINTED_AT = "grey62", "bold red", "bold yellow"


class Signs(NamedTuple):
    """What stands for what has no letter."""

    floor: str
    works: str
    broken: str
    edges: tuple[str, ...]
    """Corners from the top left on, then a horizontal and a vertical line."""


UNICODE, ASCII = Signs(".", "·", "x", tuple("┌┐└┘─│")), Signs(".", ":", "x", tuple("++++-|"))
Cell = tuple[str, str]
"""A character and its style, as rich writes it."""


def side_of(columns: int, rows: int, cells: int) -> tuple[int, int]:
    """Columns and rows of a square picture that has this room, a character being twice as high.

    cells: on a side of the map, each as large as the others; 0 for a plane.
    """
    if cells and columns >= cells and rows >= cells:
        high = max(1, min(columns // (2 * cells), rows // cells))
        wide = 2 * high if columns >= 2 * cells else 1
        return cells * wide, cells * high
    high = max(1, min(columns // 2, rows))
    return 2 * high, high


class Picture:
    """Characters that are painted on, one over the other."""

    def __init__(self, columns: int, rows: int, signs: Signs) -> None:
        self.columns, self.rows, self.signs = columns, rows, signs
        self._cells: list[list[Cell]] = [[(" ", "")] * columns for _ in range(rows)]
        self._agents = set[tuple[int, int]]()

    def paint(self, frame: Any, agents: int, chosen: int | None, pointed_at: Any) -> None:
        """Paint an `engine.episode.Frame`.

        chosen: the agent whose links alone are painted, None for all; pointed_at: a pair of agents.
        """
        if frame.cells:
            self._floor(frame.cells)
        for disc in frame.discs[agents:]:
            self._disc(disc, disc.kind[:1].upper() or "o")
        ends = frame.discs[:agents]
        links = [each for each in frame.links if chosen is None or chosen in each.pair]
        # Those that work first, the one that is pointed at last: it lies on top.
        for link in sorted(links, key=lambda each: (each.pair == pointed_at, not each.works)):
            style = _WORKS if link.works else _BROKEN
            self._line(
                self._place(ends[link.first]),
                self._place(ends[link.second]),
                self.signs.works if link.works else self.signs.broken,
                _POINTED_AT if link.pair == pointed_at else style,
            )
        for number, disc in enumerate(ends):
            self._agent(disc, is_chosen=number == chosen)

    def lines(self) -> list[list[Cell]]:
        """What has been painted, in a frame of its own; each cell may be several characters."""
        corner, right, low, last, across, down = self.signs.edges
        edge = (down, "dim")
        return [
            [(corner + across * self.columns + right, "dim")],
            *([edge, *_joined(row), edge] for row in self._cells),
            [(low + across * self.columns + last, "dim")],
        ]

    def _floor(self, cells: int) -> None:
        for row in range(cells):
            for column in range(cells):
                place = (column + 0.5) * self.columns // cells, (row + 0.5) * self.rows // cells
                self._put(int(place[0]), int(place[1]), (self.signs.floor, "grey35"))

    def _place(self, disc: Any) -> tuple[int, int]:
        """Column and row of the character that holds its centre."""
        column, row = int(disc.x * self.columns), int(disc.y * self.rows)
        return min(max(column, 0), self.columns - 1), min(max(row, 0), self.rows - 1)

    def _put(self, column: int, row: int, cell: Cell) -> None:
        if 0 <= column < self.columns and 0 <= row < self.rows:
            self._cells[row][column] = cell

    def _disc(self, disc: Any, letter: str) -> None:
        style = f"bold white on rgb({','.join(map(str, disc.colour))})"
        for column, row in self._inside(disc):
            self._put(column, row, (letter.lower(), style))
        self._put(*self._place(disc), (letter, style))

    def _inside(self, disc: Any) -> Iterator[tuple[int, int]]:
        """The characters whose centre lies in it."""
        column, row = self._place(disc)
        across, down = int(disc.radius * self.columns) + 1, int(disc.radius * self.rows) + 1
        for y in range(row - down, row + down + 1):
            for x in range(column - across, column + across + 1):
                away = ((x + 0.5) / self.columns - disc.x) ** 2
                if away + ((y + 0.5) / self.rows - disc.y) ** 2 <= disc.radius**2:
                    yield x, y

    def _agent(self, disc: Any, is_chosen: bool) -> None:
        """Write its number, beside its place where somebody else stands in it."""
        ink = "bold black on white" if is_chosen else "bold white on rgb({},{},{})"
        style = ink.format(*disc.colour)
        for column, row in self._inside(disc):
            if (column, row) not in self._agents:
                self._put(column, row, (" ", style))
        column, row = self._place(disc)
        for start in (column, column + 1, column - len(disc.label)):
            places = [(start + n, row) for n in range(len(disc.label))]
            inside = start >= 0 and start + len(disc.label) <= self.columns
            if inside and not self._agents.intersection(places):
                break
        else:
            self._put(column, row, ("*", style))
            return
        self._agents.update(places)
        for place, letter in zip(places, disc.label, strict=True):
            self._put(*place, (letter, style))

    def _line(self, start: Sequence[int], end: Sequence[int], sign: str, style: str) -> None:
        steps = max(abs(end[0] - start[0]), abs(end[1] - start[1]))
        for step in range(1, steps):
            column, row = (
                round(a + (b - a) * step / steps) for a, b in zip(start, end, strict=True)
            )
            self._put(column, row, (sign, style))


def _joined(row: Sequence[Cell]) -> Iterator[Cell]:
    """Neighbours of one style together: fewer pieces for rich to lay out."""
    for style, cells in groupby(row, key=itemgetter(1)):
        yield "".join(letter for letter, _ in cells), style
