"""Whole files or none: a reader of the results folder never sees half a figure."""

import contextlib
import os
import tempfile
from pathlib import Path

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import CANNOT_CREATE, CANNOT_WRITE


def write_atomic(path: Path, content: bytes) -> None:
    """Write beside `path`, then rename; RecordError (73 the folder, 74) leaves nothing."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordError(
            f"cannot create {path.parent}: {error.strerror}", CANNOT_CREATE
        ) from error
    temporary = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".", delete=False) as file:
            temporary = Path(file.name)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        if temporary is not None:
            with contextlib.suppress(OSError):
                temporary.unlink()
        raise RecordError(f"cannot write {path}: {error.strerror}", CANNOT_WRITE) from error
