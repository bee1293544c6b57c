"""What stands in a folder; Python tries all calls again that a signal interrupts, but not these."""

import os
from contextlib import suppress
from fnmatch import fnmatchcase
from pathlib import Path

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError, code_of


def listed(folder: Path, pattern: str = "*") -> list[Path]:
    """The paths in `folder` whose names match, sorted; none if it is missing.

    Raises RecordError if it cannot be read (2), or the disk fails (74).
    """
    try:
        names = [entry.name for entry in scanned(folder)]
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        message = one_line(f"{folder}: cannot be read: {error.strerror}")
        raise RecordError(message, code_of(error, 2)) from error
    return [folder / name for name in sorted(names) if fnmatchcase(name, pattern)]


def scanned(folder: Path) -> list[os.DirEntry[str]]:
    """The entries of `folder`, in any order. Raises OSError."""
    while True:
        with suppress(InterruptedError), os.scandir(folder) as entries:  # EINTR, of network drives
            return list(entries)
