"""Numbers as people type them on the command line."""

import math
from contextlib import suppress

from msgdrop_cli.definition.strict import LARGEST_INT, shown, without_fraction


def whole_number(text: str) -> int:
    """The whole number that somebody typed: `1000`, `1_000` or `1e3`.

    Raises ValueError for any other text and for numbers beyond 64 bits; the caller knows where.
    """
    for read in (int, float):
        with suppress(ValueError):
            value = without_fraction(read(text if text.isascii() else ""))
            if type(value) is int and abs(value) <= LARGEST_INT:
                return value
    raise ValueError(f"expected a whole number such as 1000, 1_000 or 1e3, not {shown(text)}")


def number(text: str) -> float:
    """The number that somebody typed: `0.3` or `30%`, which are equal.

    Raises ValueError for any other text and for what is not finite; the caller knows where.
    """
    if not text.isascii():
        raise ValueError(f"expected a number such as 0.3 or 30%, not {shown(text)}")
    typed = text.strip()
    digits = typed.removesuffix("%").rstrip()
    # Read as 33.3e-2, since 33.3 / 100 is another number than 0.333, and another run.
    value = float(f"{digits}e-2" if typed.endswith("%") else digits)
    if not math.isfinite(value):
        raise ValueError(f"expected a finite number, not {shown(text)}")
    return value + 0.0  # -0.0 is 0.0
