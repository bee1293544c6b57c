"""One game of navigation for people: as plain lists, as text and as a picture. No rules here."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

import torch
from torch import Tensor

from msgdrop_envs.drawing import (
    BLUE,
    GREEN,
    GRID,
    ORANGE,
    RED,
    SEEN,
    Disc,
    canvas,
    framed,
    ring,
    write,
)
from msgdrop_envs.navigation.rules import Config, State

SIDE, BORDER, OUTLINE = 630, 6, 3
"""Pixels of a picture's side without its frame, of the frame, and of a circle's line."""
SMALLEST = 5
"""Pixels of radius that a number needs; an agent far out makes everybody small."""
LETTERS = 21
"""Rows and columns of the map as text."""
LANDMARK_RADIUS = 0.05
"""As MPE draws them; nothing depends on it."""
KEYS = ("positions", "velocities", "landmarks")


class NavigationView:
    """How one game without batch dimensions is named, written down, read back and drawn."""

    version = 0
    """Bumped with every change of dynamics, reward or observation. 0: first release."""
    observation_bounds = state_bounds = (-inf, inf)

    def __init__(self, config: Config) -> None:
        self.config = config
        self.agent_names = tuple(f"agent_{number}" for number in range(config.agents))

    def state_from_dict(self, given: Any) -> State:
        """Read `{"positions": [[x, y], ...], "velocities": [...], "landmarks": [...]}`.

        Raises: ValueError for any other shape, or for what is no finite number.
        """
        if not isinstance(given, Mapping) or set(given) != set(KEYS):
            raise ValueError(f"state must hold exactly {', '.join(KEYS)}, not {given!r}")
        counts = (self.config.agents, self.config.agents, self.config.landmarks)
        return State(*(_points(given, *each) for each in zip(KEYS, counts, strict=True)))

    def state_to_dict(self, state: State) -> dict[str, Any]:
        """The position as plain lists, as `state_from_dict` takes it."""
        return {key: getattr(state, key).tolist() for key in KEYS}

    def render_text(self, state: State) -> str:
        """A map with the agents' numbers and an `x` for each landmark; +y is up."""
        held: dict[tuple[int, int], list[str]] = defaultdict(list)
        labels = ["x"] * self.config.landmarks + [str(n) for n in range(self.config.agents)]
        for point, label in zip(
            [*state.landmarks.tolist(), *state.positions.tolist()], labels, strict=True
        ):
            row, column = (int(pixel * LETTERS / SIDE) for pixel in self._pixel(state, point))
            held[row, column].append(label)
        texts = [["".join(held.get((r, c), ".")) for c in range(LETTERS)] for r in range(LETTERS)]
        width = max(len(text) for row in texts for text in row)
        edge = "+" + "-" * ((width + 1) * LETTERS + 1) + "+"
        lines = ["| " + " ".join(text.rjust(width) for text in row) + " |" for row in texts]
        covered, touching = self._covered(state), self._touching(state)
        pairs = int(touching.sum()) // 2
        left = f"{int(covered.sum())} of {len(covered)} landmarks covered, {pairs} pairs in contact"
        return "\n".join((edge, *lines, edge, left))

    def render_rgb(self, state: State) -> Tensor:
        """The world as a picture [height, width, 3] uint8, as large as it takes to show everybody.

        Numbered blue discs are agents, red-rimmed while they touch, in the tinted circle that they
        see; orange dots are landmarks, green once covered; the lines bound where games start.
        """
        image = canvas(SIDE)
        scale = SIDE / (2.0 * self._reach(state))
        agents = [self._pixel(state, point) for point in state.positions.tolist()]
        for row, column in agents:
            ring(image, row, column, 0.0, self.config.sight * scale, SEEN)
        for corner in (-1.0, 1.0):
            line, other = (int(pixel) for pixel in self._pixel(state, (corner, corner)))
            image[line] = image[:, other] = torch.tensor(GRID, dtype=torch.float32)
        radius = self.config.agent_radius * scale
        touching = self._touching(state).any(-1).tolist()
        for number, (row, column) in enumerate(agents):
            ring(image, row, column, 0.0, radius, BLUE)
            if touching[number]:
                ring(image, row, column, radius - OUTLINE, radius, RED)
            top, left, half = int(row), int(column), int(radius)
            if half >= SMALLEST:
                write(image[top - half : top + half, left - half : left + half], str(number))
        for point, covered in zip(
            state.landmarks.tolist(), self._covered(state).tolist(), strict=True
        ):
            row, column = self._pixel(state, point)
            ring(image, row, column, 0.0, LANDMARK_RADIUS * scale, GREEN if covered else ORANGE)
        return framed(image, BORDER)

    def scene(self, state: State) -> list[Disc]:
        """Agents, red while they touch, then landmarks, green once covered."""
        side = 2.0 * self._reach(state)
        touching, covered = self._touching(state).any(-1).tolist(), self._covered(state).tolist()
        points = [*state.positions.tolist(), *state.landmarks.tolist()]
        radii = [self.config.agent_radius] * len(touching) + [LANDMARK_RADIUS] * len(covered)
        colours = [RED if each else BLUE for each in touching]
        colours += [GREEN if each else ORANGE for each in covered]
        labels = [*map(str, range(len(touching))), *[""] * len(covered)]
        kinds = ["agent in contact" if each else "agent" for each in touching]
        kinds += ["covered landmark" if each else "landmark" for each in covered]
        places = ([each / SIDE for each in self._pixel(state, point)] for point in points)
        return [
            Disc(column, row, radius / side, colour, label, kind)
            for (row, column), radius, colour, label, kind in zip(
                places, radii, colours, labels, kinds, strict=True
            )
        ]

    def _covered(self, state: State) -> Tensor:
        """Which landmarks are covered [L]."""
        return (_distances(state.landmarks, state.positions) < self.config.cover_radius).any(-1)

    def _touching(self, state: State) -> Tensor:
        """Who touches whom [N, N], nobody itself."""
        near = _distances(state.positions, state.positions) < 2.0 * self.config.agent_radius
        return near & ~torch.eye(self.config.agents, dtype=torch.bool)

    def _reach(self, state: State) -> float:
        """Half the width of the world that is shown: more where somebody has left it."""
        furthest = torch.cat((state.positions, state.landmarks)).abs().max().item()
        return max(1.0, furthest) + 1.5 * self.config.agent_radius

    def _pixel(self, state: State, point: Sequence[float]) -> tuple[float, float]:
        """(row, column) of a point (x, y); +y is up."""
        reach = self._reach(state)
        return (reach - point[1]) / (2 * reach) * SIDE, (reach + point[0]) / (2 * reach) * SIDE


def _distances(one: Tensor, other: Tensor) -> Tensor:
    """[K, J] between points [K, 2] and [J, 2]."""
    return (one[:, None] - other).square().sum(-1).sqrt()


def _points(given: Mapping[str, Any], name: str, count: int) -> Tensor:
    points = given[name]
    if not isinstance(points, Sequence) or isinstance(points, str) or len(points) != count:
        raise ValueError(f"state: {name} must be a list of {count} points, not {points!r}")
    return torch.tensor([_point(point, name) for point in points], dtype=torch.float32)


def _point(point: Any, name: str) -> tuple[float, float]:
    try:
        if any(isinstance(number, bool | str) for number in point):
            raise TypeError("a number, but surely meant otherwise")
        x, y = (float(number) for number in point)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"state: {name}: {point!r} is not [x, y]") from None
    if not torch.tensor((x, y), dtype=torch.float32).isfinite().all():
        raise ValueError(f"state: {name}: {point!r} is not finite in single precision")
    return x, y
