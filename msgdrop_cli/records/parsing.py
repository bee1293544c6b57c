"""JSON that somebody else may have written: bounded before it is parsed, cleaned afterwards.

What a parser makes of a text takes up to a hundred times its bytes, and a text may come out of a
packed file that is a thousand times smaller. So bytes and values are counted first; the bounds are
ten times and more what the longest run writes.
"""

import json
import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import islice
from typing import Any, NamedTuple

from msgdrop_cli.definition.spec import MOST_LOG_ROWS
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError


class Bounds(NamedTuple):
    """What one JSON text may have."""

    size: int
    """Bytes."""
    values: int
    """Entries of lists and objects together (commas and brackets in texts are counted, too)."""


RECORD = Bounds(2**16, 2_000)
"""A run's record: real ones have 3 kB and a hundred values."""
TABLE = Bounds(2**20, 50_000)
"""Any other file; the manifest of a checkpoint in thousands of pieces is the largest."""
LONGEST_LINE = 4_096
"""Bytes of a row of a log; real ones have 350 at most."""
MOST_COLUMNS = 64
"""Of one row; real ones have 12."""
_MOST_NAMES = 256
"""Different names of columns in one log."""
_DEEPEST = 16
"""Tables and lists in each other; in a spec there are 4."""
_LONGEST_TEXT = 1_000
"""Characters; the reason of a failure is the longest, with 500."""
_AT_ONCE = 1_000
"""Rows that are parsed together."""
_ALIKE = bytes.maketrans(b"123456789E", b"000000000e")
_LARGE = (b":" + b"0" * 19, b"e000")
"""With digits alike, without signs and blanks: what a number beyond 64 bits, or one that is not
finite, has in it."""
LARGEST_NUMBER = 1e100
"""Of what is measured: sums and squares of such numbers are still finite."""
_LARGEST_INT = 2**63 - 1


def parse_json(content: bytes, place: str, bounds: Bounds = TABLE) -> Any:
    """The value in `content`, texts without control characters; `place` begins the error's line.

    Raises RecordError for what is no JSON, or more than a record of ours can be.
    """
    try:
        if len(content) > bounds.size:
            raise ValueError(f"it has more than {bounds.size:,} bytes")
        if sum(map(content.count, (b",", b"[", b"{"))) > bounds.values:
            raise ValueError(f"it has more than {bounds.values:,} values")
        return _cleaned(_parsed(content), _DEEPEST)
    except (ValueError, RecursionError) as error:
        raise RecordError(one_line(f"{place}: is damaged: {error}")) from error


def parse_rows(lines: Iterable[bytes], place: str) -> list[dict[str, Any]]:
    """The rows of a log from its lines, without their ends, of LONGEST_LINE bytes at most.

    Raises RecordError, naming `place` and the line, for what is no flat object.
    """
    rows: list[dict[str, Any]] = []
    names: dict[str, str] = {}
    lines = iter(lines)
    while batch := [*islice(lines, _AT_ONCE)]:
        fits = len(rows) + len(batch) <= MOST_LOG_ROWS
        rows += (fits and _plain_rows(batch, names)) or _each_row(batch, names, place, len(rows))
    return rows


def _plain_rows(lines: Sequence[bytes], names: dict[str, str]) -> list[dict[str, Any]] | None:
    """The rows of lines as we write them, parsed together; None if anything is unusual in them.

    That each line is a flat object of numbers, and none too large, is seen by counting signs.
    """
    content = b"\n,".join(lines)
    quotes = content.count(b'"')
    if (
        not (content.startswith(b"{") and content.endswith(b"}"))
        or content.count(b"}\n,{") != len(lines) - 1
        or content.count(b"{") != len(lines)
        or b"[" in content
        or quotes > 2 * MOST_COLUMNS * len(lines)
        or any(sign in content.translate(_ALIKE, b"+- \t\r\n") for sign in _LARGE)
    ):
        return None
    try:
        rows: list[dict[str, Any]] = _PLAIN.decode(f"[{content.decode()}]")
    except (ValueError, RecursionError):
        return None
    if 2 * sum(map(len, rows)) != quotes or max(map(len, rows)) > MOST_COLUMNS:
        return None  # texts, or a column twice
    known = {key: one_line(key) for key in set[str]().union(*rows)}
    if len(names | known) > _MOST_NAMES or any(key != known[key] for key in known):
        return None
    names |= known
    return rows


def _each_row(
    lines: Iterable[bytes], names: dict[str, str], place: str, before: int
) -> list[dict[str, Any]]:
    """The rows one by one, for what is wrong with which; before: rows before the first line."""
    rows: list[dict[str, Any]] = []
    for number, line in enumerate(lines, start=before + 1):
        try:
            if number > MOST_LOG_ROWS:
                raise ValueError(f"more than {MOST_LOG_ROWS:,} rows")
            rows.append(_row(_parsed(line), names))
        except (ValueError, RecursionError) as error:
            raise RecordError(one_line(f"{place}: line {number}: is damaged: {error}")) from error
    return rows


def _parsed(content: bytes) -> Any:
    return json.loads(
        content.decode(),
        parse_float=_finite,
        parse_int=_64_bits,
        parse_constant=_refuse_constant,
    )


def _row(value: Any, names: dict[str, str]) -> dict[str, Any]:
    """One row. names: of the columns, cleaned; all rows share them, for they fill the memory."""
    if not isinstance(value, dict):
        raise ValueError("expected an object")
    if len(value) > MOST_COLUMNS:
        raise ValueError(f"it has more than {MOST_COLUMNS} columns")
    row = {}
    for key, entry in value.items():
        if isinstance(entry, str | list | dict):
            entry = _cleaned(entry, 0)
        if key not in names:
            if len(names) == _MOST_NAMES:
                raise ValueError(f"the log has more than {_MOST_NAMES} different columns")
            names[key] = one_line(key)
        row[names[key]] = entry
    return row


def _cleaned(value: Any, depth: int) -> Any:
    """The value, at most `depth` deep and without control characters."""
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list | dict) and depth == 0:
        raise ValueError("it is nested too deeply")
    if isinstance(value, list):
        return [_cleaned(entry, depth - 1) for entry in value]
    if isinstance(value, dict):
        return {_text(key): _cleaned(entry, depth - 1) for key, entry in value.items()}
    return value


@lru_cache(maxsize=4_096)  # thousands of records say the same words; 4 MB at most
def _text(text: str) -> str:
    if len(text) > _LONGEST_TEXT:
        raise ValueError(f"a text of {len(text):,} characters, expected {_LONGEST_TEXT:,} at most")
    return one_line(text)


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:20]} is not finite")
    return number


def _64_bits(text: str) -> int:
    if len(text) > 20 or abs(number := int(text)) > _LARGEST_INT:
        raise ValueError(f"{text[:20]} is a number beyond 64 bits")
    return number


def _refuse_constant(text: str) -> float:
    raise ValueError(f"{text} is not JSON")


_PLAIN = json.JSONDecoder(parse_constant=_refuse_constant)
"""Reads numbers of any size without a look at each."""
