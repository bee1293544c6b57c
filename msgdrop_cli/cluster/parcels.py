"""The files of a run, on their way between two machines that share no folder.

They are what stands in its folder, checkpoints too, so that a run which was stopped goes on where
it is sent next. What comes back replaces what is here in such an order that a kill between any two
files leaves a run that goes on.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError, code_of
from msgdrop_cli.records.files import (
    CANNOT_CREATE,
    CANNOT_READ,
    LOCK,
    remove_file,
    write_bytes_atomic,
)
from msgdrop_cli.records.ours import CHECKPOINTS, delete_checkpoints
from msgdrop_cli.records.own_sums import RUN_SUMS
from msgdrop_cli.records.store import PROGRESS, RUN
from msgdrop_cli.records.temporary import TEMPORARY

Parcel = Mapping[str, bytes]
"""Paths below a run's folder, with slashes, and what the files hold."""
_STAYS = (LOCK, PROGRESS)
"""Of the machine where it is."""
_MANIFEST = "MANIFEST.json"
_OURS = re.compile(r"(?:checkpoints/(?:\d{15}|replay)/)?[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


def parcel(folder: Path) -> Parcel:
    """What of ours stands in a run's folder; nothing of it may be written meanwhile.

    Raises RecordError if something of it cannot be read (2, or 74 if the disk fails).
    """
    files = sorted(path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    names = {str(path.relative_to(folder)): path for path in files}
    return {
        name: _content(path)
        for name, path in names.items()
        if _OURS.fullmatch(name) and name not in _STAYS and TEMPORARY not in name
    }


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        problem = f"{path}: cannot be read: {error.strerror}"
        raise RecordError(one_line(problem), code_of(error, CANNOT_READ)) from error


def open_parcel(parcel: Parcel, folder: Path) -> None:
    """Put a run's files where this machine has them; its lock must be held.

    Raises RecordError: a name that none of ours has, nothing written (2), or no room (74).
    """
    for name in parcel:
        if not _OURS.fullmatch(name) or name in _STAYS:
            raise RecordError(one_line(f"{folder}: {name[:99]!r} came, which is no file of a run"))
    remove_file(folder / RUN_SUMS)  # of the files that are replaced now
    for name in sorted(parcel, key=_order):
        path = folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            problem = f"{path.parent}: cannot be created: {error.strerror}"
            raise RecordError(one_line(problem), CANNOT_CREATE) from error
        write_bytes_atomic(path, parcel[name])
    came = {folder / name for name in parcel}
    delete_checkpoints(folder, keep=came | {path.parent for path in came})


def _order(name: str) -> tuple[bool, bool, bool, bool, str]:
    """Replay and networks, and what declares them good; then logs, the record, its digests."""
    is_log = not name.startswith(CHECKPOINTS)
    return name == RUN_SUMS, name == RUN, is_log, name.endswith(_MANIFEST), name
