"""One game of pursuit for people: as plain lists, as text and as a picture. No rules here."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from math import ceil, sqrt
from operator import index
from typing import Any

import torch
from torch import Tensor

from msgdrop_envs.drawing import (
    BLUE,
    GRID,
    ORANGE,
    SEEN,
    Disc,
    canvas,
    fine_axis,
    framed,
    paint,
    write,
)
from msgdrop_envs.pursuit.rules import Config, State

CELL, BORDER = 42, 6
"""Pixels on a side of a cell, and pixels of frame."""


class PursuitView:
    """How one game without batch dimensions is named, written down, read back and drawn."""

    version = 0
    """Bumped with every change of dynamics, reward or observation. 0: first release."""

    def __init__(self, config: Config) -> None:
        self.config = config
        self.agent_names = tuple(f"pursuer_{number}" for number in range(config.pursuers))
        self.observation_bounds = (0, max(config.pursuers - 1, config.evaders, 1))
        self.state_bounds = (0, config.map_size - 1)
        self.cells = config.map_size

    def state_from_dict(self, given: Any) -> State:
        """Read `{"pursuers": [[row, col], ...], "evaders": [[row, col] or null, ...]}`.

        Raises: ValueError for any other shape, a cell off the map or shared where none may be, or
        no evader left.
        """
        if not isinstance(given, Mapping) or set(given) != {"pursuers", "evaders"}:
            raise ValueError(f"state must hold exactly 'pursuers' and 'evaders', not {given!r}")
        pursuers = self._cells(given, "pursuers", self.config.pursuers)
        evaders = self._cells(given, "evaders", self.config.evaders)
        free = [cell is not None for cell in evaders]
        if not all(cell is not None for cell in pursuers):
            raise ValueError("state: a pursuer's position cannot be null")
        if not self.config.may_share_cells and len(set(pursuers)) < len(pursuers):
            raise ValueError("state: two pursuers stand in one cell, and none may be shared")
        if not any(free):
            raise ValueError("state: at least one evader must have a position")
        centre = self.config.map_size // 2
        cells = [cell or (centre, centre) for cell in evaders]
        return State(torch.tensor(pursuers), torch.tensor(cells), torch.tensor(free))

    def state_to_dict(self, state: State) -> dict[str, Any]:
        """The position as plain lists, as `state_from_dict` takes it; null is a captured evader."""
        evaders = zip(state.evaders.tolist(), state.free.tolist(), strict=True)
        return {
            "pursuers": state.pursuers.tolist(),
            "evaders": [cell if free else None for cell, free in evaders],
        }

    def render_text(self, state: State) -> str:
        """The map with the pursuers' numbers and an `E` for each free evader."""
        held = self._held(state)
        rows = range(self.config.map_size)
        texts = [["".join(held.get((r, c), ".")) for c in rows] for r in rows]
        width = max(len(text) for row in texts for text in row)
        edge = "+" + "-" * ((width + 1) * self.config.map_size + 1) + "+"
        lines = ["| " + " ".join(text.rjust(width) for text in row) + " |" for row in texts]
        left = f"{int(state.free.sum())} of {self.config.evaders} evaders free"
        return "\n".join((edge, *lines, edge, left))

    def render_rgb(self, state: State) -> Tensor:
        """The map as a picture [height, width, 3] uint8; who shares a cell shares its space.

        Numbered blue discs are pursuers, orange diamonds evaders; what any pursuer sees is tinted.
        """
        side = self.config.map_size * CELL
        image = canvas(side)
        reach = self.config.sight
        for row, column in state.pursuers.tolist():
            top, left = max(row - reach, 0) * CELL, max(column - reach, 0) * CELL
            below, right = (row + reach + 1) * CELL, (column + reach + 1) * CELL
            image[top:below, left:right] = torch.tensor(SEEN, dtype=torch.float32)
        lines = torch.arange(CELL, side, CELL)
        image[lines] = torch.tensor(GRID, dtype=torch.float32)
        image[:, lines] = torch.tensor(GRID, dtype=torch.float32)
        for (row, column), labels in self._held(state).items():
            _draw_cell(image[row * CELL :, column * CELL :], labels)
        return framed(image, BORDER)

    def scene(self, state: State) -> list[Disc]:
        """Pursuers, then free evaders; who shares a cell shares its space."""
        discs: dict[str, Disc] = {}
        evaders: list[Disc] = []
        for (row, column), labels in self._held(state).items():
            rank = ceil(sqrt(len(labels)))
            for place, label in enumerate(labels):
                x = (column + (place % rank + 0.5) / rank) / self.config.map_size
                y = (row + (place // rank + 0.5) / rank) / self.config.map_size
                radius = 0.44 / rank / self.config.map_size
                if label == "E":
                    evaders.append(Disc(x, y, 0.8 * radius, ORANGE, kind="evader"))
                else:
                    discs[label] = Disc(x, y, radius, BLUE, label, "pursuer")
        return [discs[str(number)] for number in range(self.config.pursuers)] + evaders

    def _cells(
        self, given: Mapping[str, Any], name: str, count: int
    ) -> list[tuple[int, int] | None]:
        cells = given[name]
        if not isinstance(cells, Sequence) or isinstance(cells, str) or len(cells) != count:
            raise ValueError(f"state: {name} must be a list of {count} positions, not {cells!r}")
        return [None if cell is None else self._cell(cell, name) for cell in cells]

    def _cell(self, cell: Any, name: str) -> tuple[int, int]:
        size = self.config.map_size
        try:
            if any(isinstance(number, bool) for number in cell):
                raise TypeError("an index, but surely meant otherwise")
            row, column = (index(number) for number in cell)
        except (TypeError, ValueError):
            raise ValueError(f"state: {name}: {cell!r} is not [row, col]") from None
        if not (0 <= row < size and 0 <= column < size):
            raise ValueError(f"state: {name}: [{row}, {column}] is off the {size} x {size} map")
        return row, column

    def _held(self, state: State) -> dict[tuple[int, int], list[str]]:
        """Who is on each cell: pursuers by number, evaders as `E`."""
        held: dict[tuple[int, int], list[str]] = defaultdict(list)
        for row, column in state.evaders[state.free].tolist():
            held[row, column].append("E")
        for number, (row, column) in enumerate(state.pursuers.tolist()):
            held[row, column].append(str(number))
        return held


def _draw_cell(image: Tensor, labels: list[str]) -> None:
    """Draw who is on the cell in the top left corner of `image`, in a square arrangement."""
    rank = ceil(sqrt(len(labels)))
    size = CELL // rank
    margin = (CELL - ceil(len(labels) / rank) * size) // 2 + 1
    for place, label in enumerate(labels):
        top, left = place // rank * size + margin, place % rank * size + 1
        _draw_token(image[top : top + size - 1, left : left + size - 1], label)


def _draw_token(patch: Tensor, label: str) -> None:
    """Draw a diamond for `E` or a numbered disc into a square patch [side, side, 3]."""
    side = patch.shape[0]
    axis = fine_axis(side) / side * 2 - 1
    across, down = axis.abs(), axis.abs()[:, None]
    if label == "E":
        paint(patch, across + down <= 0.96, ORANGE)
    else:
        paint(patch, across**2 + down**2 <= 0.88**2, BLUE)
        write(patch, label)
