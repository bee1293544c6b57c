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


def read_log(path: Path) -> list[dict[str, Any]]:
    """The rows of a log, none if there is no such log; a torn last line is left out.

    Raises RecordError, naming file and line, for every other damage.
    """
    file = log_file(path)
    if not lexists(file):
        return []
    with _unpacked(file, file != path) as log:
        return parse_rows(_whole_lines(log, file), str(file))


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
    """The lines that end, one by one; what follows the last end was torn by a crash."""
    read = number = 0
    while line := log.readline(LONGEST_LINE + 1):
        number, read = number + 1, read + len(line)
        if len(line) > LONGEST_LINE:
            problem = f"is damaged: it has more than {LONGEST_LINE:,} bytes"
            raise RecordError(one_line(f"{file}: line {number}: {problem}"))
        _check_size(read, file)
        if line.endswith(b"\n"):
            yield line


def _check_size(size: int, file: Path) -> None:
    if size > LARGEST_FILE:
        problem = f"it unpacks to more than {LARGEST_FILE:,} bytes"
        raise RecordError(one_line(f"{file}: is no record of msgdrop: {problem}"))
