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
from msgdrop_cli.records.files import LARGEST_FILE, parse_jsonl, read_bytes, read_jsonl


def packed_name(name: str) -> str:
    """What a log is called once it is packed."""
    return f"{name}.gz"


def pack_log(path: Path) -> bytes:
    """The packed content of the log `path`; the same bytes for the same log. Raises RecordError."""
    return gzip.compress(read_bytes(path), compresslevel=9, mtime=0)


def read_log(path: Path) -> list[dict[str, Any]]:
    """The rows of a log, packed or not; none if there is no such log. RecordError if damaged."""
    packed = path.with_name(packed_name(path.name))
    if lexists(path):
        return read_jsonl(path)
    return parse_jsonl(_unpacked(packed), str(packed)) if lexists(packed) else []


def _unpacked(path: Path) -> bytes:
    try:
        with gzip.open(BytesIO(read_bytes(path))) as file:
            content = file.read(LARGEST_FILE + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise RecordError(one_line(f"{path}: is damaged: {error}")) from error
    if len(content) > LARGEST_FILE:
        raise RecordError(one_line(f"{path}: is not a record of msgdrop"))
    return content
