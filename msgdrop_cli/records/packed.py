"""Published logs: packed, since the logs of the paper's 290 runs would fill 130 MB.

A log `metrics.jsonl` is looked for under its own name first, then as `metrics.jsonl.gz`.
"""

import gzip
import zlib
from io import BytesIO
from os.path import lexists
from pathlib import Path
from typing import Any

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import LARGEST_FILE, parse_jsonl, read_bytes


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
    return read_bytes(file) if file == path else _unpacked(file)


def read_log(path: Path) -> list[dict[str, Any]]:
    """The rows of a log, none if there is no such log; a torn last line is left out.

    Raises RecordError, naming file and line, for every other damage.
    """
    content = log_bytes(path)
    return [] if content is None else parse_jsonl(content, str(log_file(path)))


def pack(content: bytes) -> bytes:
    """A log, packed without time or name: the same bytes again with the same Python and zlib."""
    return gzip.compress(content, compresslevel=9, mtime=0)


def _unpacked(path: Path) -> bytes:
    packed = read_bytes(path)
    if not packed:  # to gzip that is no damage
        raise RecordError(one_line(f"{path}: is damaged: it is empty"))
    try:
        with gzip.open(BytesIO(packed)) as file:
            content = file.read(LARGEST_FILE + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise RecordError(one_line(f"{path}: is damaged: {error}")) from error
    if len(content) > LARGEST_FILE:
        raise RecordError(one_line(f"{path}: is not a record of msgdrop"))
    return content
