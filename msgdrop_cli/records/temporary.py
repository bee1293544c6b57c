"""Files that are being written, and what is left of them when their writer was killed.

Who writes such a file holds its kernel lock, which goes with the process, however it ends: what
nobody holds is abandoned, whatever its age. Folders of this kind are `signals.scratch_folder`s.
"""

import fcntl
import os
import re
import stat
from contextlib import suppress
from functools import cache
from pathlib import Path

from msgdrop_cli.records.listings import listed, scanned
from msgdrop_cli.signals import held_back

TEMPORARY = ".tmp-"
"""Begins the names of files and folders that are being written."""
_FILE = re.compile(rf"{re.escape(TEMPORARY)}[0-9a-f]{{16}}")


def new_file(path: Path) -> tuple[Path, int]:
    """A new file beside `path`, and its handle: until that is closed, it is nobody else's.

    The first one in a folder removes there what killed processes have left. Raises OSError.
    """
    remove_abandoned(path.parent)
    while True:
        temporary = path.with_name(f"{TEMPORARY}{os.urandom(8).hex()}")
        handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        with suppress(OSError):  # some network drives have no locks: nothing is removed there
            fcntl.flock(handle, fcntl.LOCK_EX)
        if os.fstat(handle).st_nlink:  # else somebody removed it before it was locked
            return temporary, handle
        os.close(handle)


@cache  # once in a process: a folder may hold thousands of files
def remove_abandoned(folder: Path) -> None:
    """Remove our user's files in `folder` that were being written and that no process holds."""
    with suppress(OSError):
        for entry in scanned(folder):
            if _FILE.fullmatch(entry.name):
                _remove_unless_held(entry.path)


def _remove_unless_held(path: str) -> None:
    with suppress(OSError):
        # O_NONBLOCK: opening somebody's named pipe must not wait for its other end.
        handle = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            facts = os.fstat(handle)
            if stat.S_ISREG(facts.st_mode) and facts.st_uid == os.getuid():
                Path(path).unlink()
        finally:
            os.close(handle)


def put_in_place(new: Path, target: Path) -> None:
    """Rename a whole folder to `target`; what was there goes beside `new`, into a scratch folder.

    A signal, which would remove that folder, waits until the new one stands. Raises OSError, with
    the old one where it was.
    """
    old = new.with_name(f"{TEMPORARY}old")
    with held_back():
        if os.path.lexists(target):
            target.rename(old)
        try:
            new.rename(target)
        except OSError:
            if os.path.lexists(old):
                old.rename(target)
            raise


def remove_leftovers(run_path: Path) -> None:
    """Remove what was being written in a run folder; only the lock's holder writes there.

    Raises RecordError (2) if it cannot be read.
    """
    for leftover in listed(run_path, f"{TEMPORARY}*"):
        with suppress(OSError):
            leftover.unlink()
