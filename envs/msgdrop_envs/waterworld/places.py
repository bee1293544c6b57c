"""Where things of waterworld appear: anywhere in the square but near the obstacle, without trying.

MADRL draws places until one is free. Here uniform numbers come from outside and their count is
fixed, so two of them are mapped to one free place, with the same distribution.
"""

import math

import torch
from torch import Tensor

NEWTON_STEPS = 6
"""More change nothing in float32, for any radius up to 0.49."""


def outside(uniforms: Tensor, radius: Tensor) -> Tensor:
    """Points of the unit square, evenly spread outside a disc of this radius in its middle.

    An exact mapping of two uniform numbers to one point. The square is cut into four sides; a
    point of the first is middle + (h, h t) with |t| <= 1, and area is h dh dt. So the share of
    area below t goes as t - 4 R^2 atan t, which Newton's rule inverts, and given t, h^2 is uniform
    from R^2 / (1 + t^2) to 1/4. uniforms: [..., 2]; radius: [...], below 0.5; returns [..., 2].
    """
    first, second = uniforms.unbind(-1)
    radius = radius.expand_as(first)
    side = (first * 4).floor()
    # Packed, since torch may round the atan of strided numbers differently.
    lean = (2 * (first * 4 - side) - 1).contiguous()
    bend = 4 * radius * radius
    share = lean * (1 - math.pi / 4 * bend)
    t = lean
    for _ in range(NEWTON_STEPS):
        t = t - (t - bend * t.atan() - share) / (1 - bend / (1 + t * t))
    nearest = radius * radius / (1 + t * t)
    along = (nearest + second * (0.25 - nearest)).sqrt()
    across = along * t
    along = along * (1 - 2 * (side % 2))
    upright = side >= 2
    point = torch.stack(
        (torch.where(upright, across, along), torch.where(upright, along, across)), -1
    )
    return (0.5 + point).clamp(0, 1)
