"""One game of waterworld for people: as plain lists, as text and as a picture. No rules here."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from msgdrop_envs.drawing import BACKGROUND, BLUE, FRAME, ORANGE, Disc, write
from msgdrop_envs.waterworld.config import Config
from msgdrop_envs.waterworld.rules import State

SIDE, BORDER = 720, 6
"""Pixels on a side of the square, and of frame around it."""
SEEN, OBSTACLE = (198, 218, 234), (150, 150, 152)
PURPLE = (102, 45, 120)
COLUMNS, ROWS = 50, 25
"""Characters of the text."""
KINDS = ("pursuers", "food", "poison")
PARTS = ("positions", "velocities")
FASTEST = 1.0
"""Nobody keeps a faster velocity along an axis: the next step ends at the wall."""


class WaterworldView:
    """How one game without batch dimensions is named, written down, read back and drawn."""

    version = 0
    """Bumped with every change of dynamics, reward or observation. 0: first release."""

    def __init__(self, config: Config) -> None:
        self.config = config
        self.agent_names = tuple(f"pursuer_{number}" for number in range(config.pursuers))
        self._numbers = (config.pursuers, config.food, config.poison)
        unit = config.velocity_unit if config.sensors_scaled else 1.0
        largest = max(1.0, 3 * FASTEST / unit)  # two fastest against each other, on the diagonal
        self.observation_bounds = (-largest, largest)
        fastest = max(FASTEST, config.food_speed / 2, config.poison_speed / 2)
        self.state_bounds = (-fastest, fastest)

    def state_from_dict(self, given: Any) -> State:
        """Read `{"pursuers": {"positions": [[x, y], ...], "velocities": [[x, y], ...]}, ...}`.

        `food` and `poison` are written as `pursuers` are. Raises: ValueError for any other shape,
        a place outside the unit square, or a velocity above 1 along an axis.
        """
        _require_keys(given, KINDS, "state")
        parts: dict[str, list[list[float]]] = {part: [] for part in PARTS}
        for kind, number in zip(KINDS, self._numbers, strict=True):
            _require_keys(given[kind], PARTS, f"state: {kind}")
            for part in PARTS:
                low, high = (0.0, 1.0) if part == "positions" else (-FASTEST, FASTEST)
                rows = given[kind][part]
                if not isinstance(rows, Sequence) or isinstance(rows, str) or len(rows) != number:
                    raise ValueError(f"state: {kind}: {part} must be a list of {number} pairs")
                parts[part] += [_pair(row, low, high, f"state: {kind}: {part}") for row in rows]
        return State(torch.tensor(parts["positions"]), torch.tensor(parts["velocities"]))

    def state_to_dict(self, state: State) -> dict[str, Any]:
        """The state as plain lists, as `state_from_dict` takes it."""
        places, speeds = (t.split(self._numbers) for t in (state.positions, state.velocities))
        return {
            kind: {"positions": place.tolist(), "velocities": speed.tolist()}
            for kind, place, speed in zip(KINDS, places, speeds, strict=True)
        }

    def render_text(self, state: State) -> str:
        """The square, north up: pursuers by number (`*` for several), `F`ood, poi`x`on, obstacle.

        What is smaller than a character stands on the character that holds its centre.
        """
        lines = [[self._ground(row, column) for column in range(COLUMNS)] for row in range(ROWS)]
        pursuers, food, poison = state.positions.split(self._numbers)
        for group, sign in ((poison, "x"), (food, "F")):
            for place in group.tolist():
                row, column = _character(place)
                lines[row][column] = sign
        places = [_character(place) for place in pursuers.tolist()]
        for number, ((row, column), crowd) in enumerate(
            (place, Counter(places)[place]) for place in places
        ):
            lines[row][column] = str(number % 10) if crowd == 1 else "*"
        edge = "+" + "-" * COLUMNS + "+"
        legend = "0-9 pursuers, * several, F food, x poison, # obstacle"
        return "\n".join((edge, *(f"|{''.join(line)}|" for line in lines), edge, legend))

    def render_rgb(self, state: State) -> Tensor:
        """The square as a picture [height, width, 3] uint8, north up.

        Numbered blue discs with their sensors are pursuers, orange is food, purple is poison.
        """
        config = self.config
        image = torch.tensor(BACKGROUND, dtype=torch.float32).repeat(SIDE, SIDE, 1)
        _disc(image, (0.5, 0.5), config.obstacle_radius, OBSTACLE)
        pursuers, food, poison = (part.tolist() for part in state.positions.split(self._numbers))
        for place in pursuers:
            self._rays(image, place)
        _, food_radius, poison_radius = config.radii
        for places, radius, colour in (
            (food, food_radius, ORANGE),
            (poison, poison_radius, PURPLE),
            (pursuers, config.radius, BLUE),
        ):
            for place in places:
                _disc(image, place, radius, colour)
        for number, (x, y) in enumerate(pursuers):
            half = max(8, round(config.radius * SIDE))
            top = min(max(round((1 - y) * SIDE) - half, 0), SIDE - 2 * half)
            left = min(max(round(x * SIDE) - half, 0), SIDE - 2 * half)
            write(image[top : top + 2 * half, left : left + 2 * half], str(number))
        framed = torch.tensor(FRAME, dtype=torch.float32).repeat(
            SIDE + 2 * BORDER, SIDE + 2 * BORDER, 1
        )
        framed[BORDER:-BORDER, BORDER:-BORDER] = image
        return framed.round().to(torch.uint8)

    def scene(self, state: State) -> list[Disc]:
        """Pursuers, food, poison, and the obstacle."""
        radii = (self.config.radius, *self.config.radii[1:])
        parts = zip(
            *(("pursuer", "food", "poison"), state.positions.split(self._numbers)),
            *(radii, (BLUE, ORANGE, PURPLE)),
            strict=True,
        )
        discs = [
            Disc(x, 1.0 - y, radius, colour, str(number) if colour == BLUE else "", kind)
            for kind, part, radius, colour in parts
            for number, (x, y) in enumerate(part.tolist())
        ]
        radius = self.config.obstacle_radius
        return [*discs, Disc(0.5, 0.5, radius, OBSTACLE, kind="obstacle")]

    def _ground(self, row: int, column: int) -> str:
        x, y = (column + 0.5) / COLUMNS, 1 - (row + 0.5) / ROWS
        return "#" if math.dist((x, y), (0.5, 0.5)) <= self.config.obstacle_radius else " "

    def _rays(self, image: Tensor, place: Sequence[float]) -> None:
        """Draw the sensors of one pursuer as thin lines."""
        patch, across, up = _patch(image, place, self.config.sensor_range)
        angles = torch.arange(self.config.sensors) * (2 * math.pi / self.config.sensors)
        cos, sin = angles.cos()[:, None, None], angles.sin()[:, None, None]
        along = (across * cos + up * sin).clamp(0, self.config.sensor_range * SIDE)
        apart = torch.hypot(across - along * cos, up - along * sin).amin(0)
        _paint(patch, (1 - apart).clamp(0, 1), SEEN)


def _require_keys(given: Any, keys: Sequence[str], where: str) -> None:
    if not isinstance(given, Mapping) or set(given) != set(keys):
        named = ", ".join(map(repr, keys))
        found = list(given) if isinstance(given, Mapping) else given
        raise ValueError(f"{where} must hold exactly {named}, not {found!r}")


def _pair(row: Any, low: float, high: float, where: str) -> list[float]:
    """Two numbers within these bounds, or a ValueError."""
    try:
        numbers = [] if isinstance(row, str) else [float(number) for number in row]
        if any(isinstance(number, bool) for number in row):
            raise TypeError("a number, but surely meant otherwise")
    except (TypeError, ValueError):
        raise ValueError(f"{where}: {row!r} is not [x, y]") from None
    if len(numbers) != 2:
        raise ValueError(f"{where}: {row!r} is not [x, y]")
    if not all(low <= number <= high for number in numbers):
        raise ValueError(f"{where}: {row!r} is not within {low:g} to {high:g}")
    return numbers


def _character(place: Sequence[float]) -> tuple[int, int]:
    """Row and column of the character that holds this place."""
    x, y = place
    return min(int((1 - y) * ROWS), ROWS - 1), min(int(x * COLUMNS), COLUMNS - 1)


def _patch(image: Tensor, place: Sequence[float], radius: float) -> tuple[Tensor, Tensor, Tensor]:
    """The part of the image around a place, and its pixels' way east [1, w] and north [h, 1]."""
    x, y = place[0] * SIDE, (1 - place[1]) * SIDE
    reach = radius * SIDE + 2
    left, top = max(int(x - reach), 0), max(int(y - reach), 0)
    patch = image[top : int(y + reach) + 1, left : int(x + reach) + 1]
    rows, columns = patch.shape[:2]
    return (
        patch,
        torch.arange(columns)[None] + (left + 0.5 - x),
        y - top - 0.5 - torch.arange(rows)[:, None],
    )


def _disc(
    image: Tensor, place: Sequence[float], radius: float, colour: tuple[int, int, int]
) -> None:
    patch, across, up = _patch(image, place, radius)
    _paint(patch, (radius * SIDE + 0.5 - torch.hypot(across, up)).clamp(0, 1), colour)


def _paint(patch: Tensor, cover: Tensor, colour: tuple[int, int, int]) -> None:
    """Blend a colour into a patch [h, w, 3] by its cover [h, w], 0 to 1."""
    patch += cover[..., None] * (torch.tensor(colour, dtype=torch.float32) - patch)
