"""Whole files or none: a reader of the results folder never sees half a figure."""

from pathlib import Path

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import CANNOT_CREATE, write_bytes_atomic


def write_atomic(path: Path, content: bytes) -> None:
    """Write `path` and its folder; RecordError (73 the folder, 74) leaves nothing half-written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordError(
            f"{path.parent}: cannot be created: {error.strerror}", CANNOT_CREATE
        ) from error
    write_bytes_atomic(path, content)
