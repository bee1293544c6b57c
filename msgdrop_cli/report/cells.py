"""Tables as CSV that is safe to open: a text of a stranger's is never taken for a formula."""

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

_FORMULAS = ("=", "+", "-", "@")
"""What a cell of a spreadsheet begins with if it is computed."""


def csv_bytes(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> bytes:
    """One line a row below the columns' names; numbers to the last digit, None as nothing.

    A text that a spreadsheet would compute stands behind an apostrophe.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(_cell, columns))
    writer.writerows([[_cell(value) for value in row] for row in rows])
    return text.getvalue().encode()


def _cell(value: Any) -> Any:
    risky = isinstance(value, str) and value.lstrip().startswith(_FORMULAS)
    return f"'{value}" if risky else value
