"""A channel with one setting that runs over a range: `loss:0..1:11`, `bursts:0..0.5:6,4`."""

import re
from dataclasses import dataclass

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.strict import shown
from msgdrop_cli.definition.typed_numbers import number, whole_number
from msgdrop_cli.errors import DefinitionError

_RANGE = re.compile(r"([0-9.]+(?:e-?[0-9]+)?%?)\.\.([0-9.]+(?:e-?[0-9]+)?%?):([0-9]+)(?=[,+]|$)")
_MOST_POINTS = 101


@dataclass(frozen=True, slots=True)
class Sweep:
    """The channels of a range, in order of the setting that changes."""

    text: str
    """As it was asked for."""
    values: tuple[float, ...]
    channels: tuple[Channel, ...]

    @property
    def name(self) -> str:
        """For an axis: `loss`, `bursts x, 4`: the place of what changes."""
        left, right = _RANGE.split(self.text)[:: len(_RANGE.split(self.text)) - 1]
        rest = f"{left.partition(':')[2]}x{right}"
        return self.channels[0].kind + (f" {rest}" if rest != "x" else "")

    @classmethod
    def read(cls, text: str, option: str) -> "Sweep":
        """What people write. Raises DefinitionError for anything that is no range of channels."""
        found = _RANGE.findall(text)
        problem = f"{option}: expected kind:LOW..HIGH:POINTS (loss:0..1:11), not {shown(text)}"
        if len(found) != 1:
            raise DefinitionError(problem)
        low, high, points = found[0]
        try:
            first, last, count = number(low), number(high), whole_number(points)
        except ValueError as error:
            raise DefinitionError(problem) from error
        if not (first < last and 2 <= count <= _MOST_POINTS):
            raise DefinitionError(
                f"{option}: expected LOW below HIGH and 2 to {_MOST_POINTS} points in {shown(text)}"
            )
        step = (last - first) / (count - 1)
        # In twelve digits, so that tenths are tenths.
        values = tuple(float(f"{first + step * place:.12g}") for place in range(count))
        if len(set(values)) < count:
            raise DefinitionError(f"{option}: the points of {shown(text)} lie too near")
        try:
            channels = tuple(Channel.read(_RANGE.sub(f"{value:.12g}", text)) for value in values)
            channels = tuple(channel.located() for channel in channels)
        except ValueError as error:
            raise DefinitionError(f"{option}: {error}") from error
        return cls(text, values, channels)
