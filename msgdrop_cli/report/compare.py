"""A file that was made again against the one that is there: text by its lines, figures as a whole.

The same figure has other bytes where another matplotlib drew it, so such two are not compared.
"""

import re
from itertools import zip_longest
from pathlib import Path

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.records.files import read_bytes
from msgdrop_cli.records.sums import Difference

_FIGURES = (".png", ".pdf", ".svg")
_DRAWN_BY = re.compile(rb"[Mm]atplotlib\D{0,30}?(\d+(?:\.\d+)+)")
"""In the metadata of a figure of any format."""
_AROUND = 32
"""Letters shown before the first that differs, and about twice as many from there on."""


def difference(made: Path, there: Path) -> Difference | None:
    """The first difference of two files; None if there is none, or none that is compared.

    Raises RecordError if one of them cannot be read.
    """
    expected, found = read_bytes(made), read_bytes(there)
    if expected == found or not is_compared(made, there):
        return None
    if made.suffix in _FIGURES:
        return Difference(there, "figure", "the one that its records give", "another")
    lines = zip_longest(expected.split(b"\n"), found.split(b"\n"))
    for number, (line, other) in enumerate(lines, start=1):
        if line != other:
            return Difference(there, f"line {number}", *_excerpts(line, other))
    return None


def is_compared(made: Path, there: Path) -> bool:
    """Whether two files are alike if they show the same: text, or drawn by one matplotlib."""
    if made.suffix not in _FIGURES:
        return True
    expected, found = read_bytes(made), read_bytes(there)
    return expected == found or _drawn_by(expected) == _drawn_by(found) != ""


def _drawn_by(figure: bytes) -> str:
    """The version of matplotlib, empty if the figure does not say."""
    said = _DRAWN_BY.search(figure)
    return said[1].decode() if said else ""


def _excerpts(expected: bytes | None, found: bytes | None) -> tuple[str, str]:
    """Both lines from a little before the first letter that differs; None: beyond the last."""
    line, other = ((each or b"").decode(errors="replace") for each in (expected, found))
    alike = (n for n, (a, b) in enumerate(zip(line, other, strict=False)) if a != b)
    same = next(alike, min(len(line), len(other)))
    end = "the end of the file"
    return (
        end if expected is None else _excerpt(line, same),
        end if found is None else _excerpt(other, same),
    )


def _excerpt(line: str, same: int) -> str:
    start, end = max(0, same - _AROUND), same + 2 * _AROUND
    before, after = "…" if start else "", "…" if end < len(line) else ""
    return repr(one_line(f"{before}{line[start:end]}{after}"))
