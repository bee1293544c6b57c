"""Published logs: packed, since the logs of the paper's 290 runs would fill 130 MB.

A log `metrics.jsonl` is looked for under its own name first, then as `metrics.jsonl.gz`.
"""

import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedIOBase
from os.path import lexists
from pathlib import Path
from typing import Any

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import LARGEST_FILE, opened
from msgdrop_cli.records.parsing import LONGEST_LINE, parse_rows

LARGEST_PACKED = LARGEST_FILE // 4
"""Bytes of a packed log; numbers shrink to a sixth."""
_BLOCK = 2**18
"""Bytes that are read at once: no more of a log is in the memory beside its rows."""


def packed_name(name: str) -> str:
    """What a log is called once it is packed."""
    return f"{name}.gz"


def log_file(path: Path) -> Path:
    """The file that the log `path` is in: itself, or its packed copy where there is only that."""
    packed = path.with_name(packed_name(path.name))
    return packed if lexists(packed) and not lexists(path) else path


def log_bytes(path: Path) -> bytes | None:
    """A log, unpacked; None if there is no such log. Raises RecordError if it is damaged."""
    file = log_file(path)
    if not lexists(file):
        return None
    with _unpacked(file, file != path) as log:
        content = log.read(LARGEST_FILE + 1)
    _check_size(len(content), file)
    return content


def read_log(path: Path, *numbers: str) -> list[dict[str, Any]]:
    """The rows of a log, none if there is no such log; a torn last line is left out.

    numbers: what must be one in every row. Raises RecordError, naming file and line, for every
    other damage.
    """
    file = log_file(path)
    if not lexists(file):
        return []
    with _unpacked(file, file != path) as log:
        rows = parse_rows(_whole_lines(log, file), str(file))
    for number, row in enumerate(rows, start=1):
        for key in numbers:
            if type(row.get(key)) not in (int, float) or abs(row[key]) >= 2**63:
                problem = f"line {number}: {key!r} is not a number of 64 bits"
                raise RecordError(one_line(f"{file}: {problem}"))
    return rows


def pack(content: bytes) -> bytes:
    """A log, packed without time or name: the same bytes again with the same Python and zlib."""
    return gzip.compress(content, compresslevel=9, mtime=0)


@contextmanager
def _unpacked(file: Path, is_packed: bool) -> Iterator[BufferedIOBase]:
    """A log as it is read: no more of it is in the memory than what was asked for."""
    with opened(file, LARGEST_PACKED if is_packed else LARGEST_FILE) as stored:
        if not is_packed:
            yield stored
            return
        try:
            if not stored.peek(1):  # to gzip that is no damage
                raise EOFError("it is empty")
            with gzip.open(stored) as log:
                yield log
        except (OSError, EOFError, zlib.error) as error:
            raise RecordError(one_line(f"{file}: is damaged: {error}")) from error


def _whole_lines(log: BufferedIOBase, file: Path) -> Iterator[bytes]:
    """The lines that end, without their ends; what follows the last one was torn by a crash."""
    read = number = 0
    rest = b""
    while block := log.read(_BLOCK):
        read += len(block)
        _check_size(read, file)
        *lines, rest = (rest + block).split(b"\n")
        if max(map(len, (*lines, rest))) >= LONGEST_LINE:
            long = [len(line) >= LONGEST_LINE for line in (*lines, rest)].index(True)
            problem = f"is damaged: it has more than {LONGEST_LINE:,} bytes"
            raise RecordError(one_line(f"{file}: line {number + long + 1}: {problem}"))
        number += len(lines)
        yield from lines


def _check_size(size: int, file: Path) -> None:
    if size > LARGEST_FILE:
        problem = f"it unpacks to more than {LARGEST_FILE:,} bytes"
        raise RecordError(one_line(f"{file}: is no record of msgdrop: {problem}"))
