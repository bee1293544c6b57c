"""What the pictures of all games are made of: colours, smooth shapes and small numbers.

A picture is a float tensor [height, width, 3] that is painted on in place, row 0 at the top.
"""

from typing import NamedTuple

import torch
from torch import Tensor

Colour = tuple[int, int, int]
BACKGROUND, GRID, SEEN, FRAME = (250, 250, 247), (222, 222, 217), (227, 237, 246), (70, 70, 74)
BLUE, ORANGE, GREEN, RED, WHITE = (
    *((0, 98, 158), (222, 106, 16), (38, 134, 74)),
    *((190, 30, 45), (255, 255, 255)),
)
FINE = 3
"""Samples per pixel and axis for smooth edges."""
DIGITS = {
    "0": "111101101101111",
    "1": "010110010010111",
    "2": "111001111100111",
    "3": "111001111001111",
    "4": "101101111001001",
    "5": "111100111001111",
    "6": "111100111101111",
    "7": "111001010010010",
    "8": "111101111101111",
    "9": "111101111001111",
}
"""Three columns by five rows."""


class Disc(NamedTuple):
    """Somebody or something in a replay; lengths are parts of the picture's side, y goes down."""

    x: float
    y: float
    radius: float
    colour: Colour
    label: str = ""
    """An agent's number."""
    kind: str = ""
    """What it is, in a word or two; its first letter stands for it where there are only letters."""


def canvas(side: int) -> Tensor:
    """An empty square picture [side, side, 3]."""
    return torch.tensor(BACKGROUND, dtype=torch.float32).repeat(side, side, 1)


def framed(image: Tensor, border: int) -> Tensor:
    """The square picture with a frame of so many pixels round it, as uint8."""
    side = image.shape[0] + 2 * border
    whole = torch.tensor(FRAME, dtype=torch.float32).repeat(side, side, 1)
    whole[border:-border, border:-border] = image
    return whole.round().to(torch.uint8)


def fine_axis(pixels: int) -> Tensor:
    """Where the samples of so many pixels lie, in pixels: [pixels * FINE]."""
    return (torch.arange(pixels * FINE) + 0.5) / FINE


def paint(patch: Tensor, shape: Tensor, colour: Colour) -> None:
    """Colour the samples for which `shape` [height * FINE, width * FINE] holds."""
    cover = shape.float().unfold(0, FINE, FINE).unfold(1, FINE, FINE).mean((-1, -2))[..., None]
    patch += cover * (torch.tensor(colour, dtype=torch.float32) - patch)


def ring(
    image: Tensor, row: float, column: float, inner: float, outer: float, colour: Colour
) -> None:
    """Paint what lies between two radii around (row, column), in pixels; inner 0 is a disc."""
    top, left = max(int(row - outer), 0), max(int(column - outer), 0)
    patch = image[top : max(int(row + outer) + 2, 0), left : max(int(column + outer) + 2, 0)]
    down = fine_axis(patch.shape[0])[:, None] + (top - row)
    across = fine_axis(patch.shape[1]) + (left - column)
    squared = down**2 + across**2
    paint(patch, (squared >= inner**2) & (squared <= outer**2), colour)


def write(patch: Tensor, label: str) -> None:
    """Write the number in white into the middle of the patch, as large as fits well."""
    rows = [".".join(DIGITS[digit][3 * row : 3 * row + 3] for digit in label) for row in range(5)]
    dots = torch.tensor([[dot == "1" for dot in row] for row in rows])
    scale = max(1, patch.shape[0] // (9 if len(label) == 1 else 13))
    dots = dots.repeat_interleave(scale, 0).repeat_interleave(scale, 1)
    top, left = (patch.shape[0] - dots.shape[0]) // 2, (patch.shape[1] - dots.shape[1]) // 2
    inside = patch[top : top + dots.shape[0], left : left + dots.shape[1]]
    inside[dots] = torch.tensor(WHITE, dtype=torch.float32)
