"""Letters in figures: which ones the font has, how wide a line is, where it breaks."""

import unicodedata
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from msgdrop_cli.report.settings import FONT

if TYPE_CHECKING:
    from matplotlib.ft2font import FT2Font

Weight = Literal["normal", "bold"]
LINE = 1.2 / 72.0
"""Height of a line in inches for each point of its size."""
UNKNOWN = "?"
"""Stands for every run of letters that the font has not."""
_LONGEST = 96
"""Letters of a name."""
_DOTS = 1200.0
"""Of an inch, for measures; at few dots letters are as wide as whole dots."""
_BREAKS = "._-=/,:"
"""Signs in a long word that a line may end with."""


def drawable(text: str) -> str:
    """The text in letters that the font has.

    Composed, and by Unicode's compatible letters where only those can be drawn (wide ones as plain
    ones); every other run, a word of Chinese or an emoji, becomes one UNKNOWN.
    """
    known = _font("normal").get_charmap()
    drawn = ""
    for letter in unicodedata.normalize("NFC", text):
        plain = letter if ord(letter) in known else unicodedata.normalize("NFKD", letter)
        if all(ord(each) in known for each in plain):
            drawn += plain
        elif not drawn.endswith(UNKNOWN):
            drawn += UNKNOWN
    return drawn


def drawable_name(text: str) -> str:
    """A drawable text, without the middle of one beyond measure: names often differ at an end."""
    text = drawable(text)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]}…{text[-_LONGEST // 2 :]}"


@lru_cache(maxsize=4_096)  # the same words on every figure
def width(text: str, size: float, weight: Weight = "normal") -> float:
    """Of one line of drawable text, in inches; size in points."""
    font = _font(weight)
    font.set_size(size, _DOTS)
    font.set_text(text)
    return float(font.get_width_height()[0]) / 64.0 / _DOTS


def wrapped(text: str, inches: float, size: float, weight: Weight = "normal") -> list[str]:
    """The drawable text in lines that are no wider than `inches`; a longer word is broken."""
    lines = [""]
    for word in text.split():
        if lines[-1] and width(f"{lines[-1]} {word}", size, weight) > inches:
            lines.append("")
        lines[-1] += f" {word}" if lines[-1] else word
        while len(lines[-1]) > 1 and width(lines[-1], size, weight) > inches:
            line = lines.pop()
            fits = [n for n in range(1, len(line)) if width(line[:n], size, weight) <= inches]
            at_signs = [n for n in fits if line[n - 1] in _BREAKS]
            end = max(at_signs or fits, default=1)
            lines += [line[:end], line[end:]]
    return lines


def _font(weight: Weight) -> "FT2Font":
    from matplotlib.font_manager import FontProperties, findfont, get_font

    return get_font(findfont(FontProperties(family=FONT, weight=weight)))
