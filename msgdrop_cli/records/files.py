"""Files and logs that survive kill -9, full disks, network drives and other people's files.

What is read was perhaps written by somebody else: any damage is a RecordError of one line. No link
is followed, neither for reading nor for writing, and modes follow the umask.
"""

import errno
import fcntl
import json
import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import DISK_FAULTS, RecordError, code_of
from msgdrop_cli.records.parsing import TABLE, Bounds, parse_json
from msgdrop_cli.records.temporary import new_file, remove_leftovers

CANNOT_READ, CANNOT_CREATE, CANNOT_WRITE, BUSY = 2, 73, 74, 75
LARGEST_FILE = 32 * 2**20
"""Bytes of a log or of a policy; real ones have two million at most."""
LOCK = "lock"
"""The file of a run folder that whoever writes there holds; the name of its epoch stands in it."""
_LONGEST_EPOCH = 64
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL)


def write_json_atomic(path: Path, value: Any, *, durable: bool = True) -> None:
    """Replaces `path` by `value` as JSON: a reader sees the old file or the new one, never a part.

    `durable=False` leaves out the fsyncs: for what is only shown to people.
    Raises RecordError (74), the old file intact; ValueError for NaN, a mistake of the caller.
    """
    write_bytes_atomic(path, json_bytes(value), durable=durable)


def json_bytes(value: Any) -> bytes:
    """The content of a JSON file; ValueError for NaN, a mistake of the caller."""
    return (json.dumps(value, indent=2, allow_nan=False) + "\n").encode()


def jsonl_bytes(rows: Iterable[Mapping[str, Any]]) -> bytes:
    """The content of a log with these rows."""
    return "".join(json.dumps(row, allow_nan=False) + "\n" for row in rows).encode()


def write_bytes_atomic(path: Path, content: bytes, *, durable: bool = True) -> None:
    """Replaces `path`, or a link there, by `content`, whole or not at all; RecordError (74).

    A device or a pipe is refused (73): for the superuser /dev/null would be a file from then on.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise RecordError(_message(path, "is there and is no file; name another"), CANNOT_CREATE)
    try:
        temporary, handle = new_file(path)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                if durable:
                    _sync(handle)
                temporary.replace(path)  # while it is held
        except OSError:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise
        if durable:
            sync_folder(path.parent)
    except OSError as error:
        raise _failed("cannot be written", path, error, CANNOT_WRITE) from error


def append_jsonl(path: Path, *rows: Mapping[str, Any], durable: bool = True) -> None:
    """Appends the rows in one write, and all of them or none.

    `durable=False` leaves out the fsync, for who calls `sync_file` before anything counts on them.
    A log that a killed process left torn has to be cut (`cut_jsonl`) before it is appended to.
    Raises RecordError (74); ValueError for NaN, a mistake of the caller.
    """
    content = "".join(json.dumps(row, allow_nan=False) + "\n" for row in rows).encode()
    try:
        handle = _opened(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        try:
            before = os.fstat(handle).st_size
            try:
                if os.write(handle, content) < len(content):
                    raise OSError(0, "the disk took only a part")
                if durable:
                    _sync(handle)
            except OSError:
                os.ftruncate(handle, before)
                raise
        finally:
            os.close(handle)
    except OSError as error:
        raise _failed("cannot be written", path, error, CANNOT_WRITE) from error


def cut_jsonl(path: Path, keep: int) -> None:
    """Cuts the log back to its first `keep` rows; a missing log has none.

    Raises RecordError: fewer whole rows than `keep` (2), or not writable (74).
    """
    if keep == 0 and not os.path.lexists(path):
        return
    content, end = read_bytes(path), 0
    for row in range(keep):
        if (end := content.find(b"\n", end) + 1) == 0:
            raise RecordError(_message(path, f"expected {keep} rows, only {row} are whole"))
    try:
        handle = _opened(path, os.O_WRONLY)
        try:
            os.ftruncate(handle, end)
            _sync(handle)
        finally:
            os.close(handle)
    except OSError as error:
        raise _failed("cannot be written", path, error, CANNOT_WRITE) from error


def count_jsonl(path: Path) -> int:
    """Whole rows in the log `path`, 0 for a missing one; RecordError (2) if it is no file."""
    return read_bytes(path).count(b"\n") if os.path.lexists(path) else 0


def read_json(path: Path, bounds: Bounds = TABLE) -> Any:
    """The value in `path`, texts without control characters.

    Raises RecordError if it is damaged or larger than `bounds`.
    """
    return parse_json(read_bytes(path, bounds.size), str(path), bounds)


def read_bytes(path: Path, largest: int = LARGEST_FILE) -> bytes:
    """The bytes of a regular file that is no link and has at most `largest` bytes.

    Raises RecordError (2) for any other file.
    """
    with opened(path, largest) as file:
        return file.read()


@contextmanager
def opened(path: Path, largest: int = LARGEST_FILE) -> Iterator[BufferedReader]:
    """The file that `read_bytes` would read, for who takes it piece by piece."""
    try:
        with os.fdopen(_opened(path, os.O_RDONLY), "rb") as file:
            if os.fstat(file.fileno()).st_size > largest:
                raise RecordError(
                    _message(path, f"is no record of msgdrop: it has more than {largest:,} bytes")
                )
            yield file
    except (OSError, ValueError) as error:
        raise _failed("cannot be read", path, error, CANNOT_READ) from error


@dataclass(frozen=True, slots=True)
class Epoch:
    """The time in which one process writes in a run folder: from its lock until the next one's.

    A process that was stopped may wake up when its folder has been made anew, or its lock file has
    gone, or where the file system has no locks: it finds another name in the file, and must not go
    on.
    """

    path: Path
    """The run folder."""
    name: str

    def check(self) -> None:
        """Raises RecordError: another process has begun to write there (75); a bad disk (74)."""
        try:
            current = read_bytes(self.path / LOCK, _LONGEST_EPOCH)
        except RecordError as error:
            if error.exit_code == CANNOT_WRITE:
                raise
            current = b""
        if current != self.name.encode():
            problem = "another process has taken it over; nothing more is written by this one"
            raise RecordError(_message(self.path, problem), BUSY)


@contextmanager
def run_lock(path: Path) -> Iterator[Epoch]:
    """Holds the kernel's lock of the run folder `path`, which is made if need be.

    The lock goes with the process, however it ends; there is nothing to clean up. A file system
    without locks gives none; `commands.parts.estimate.check_folder` says so before anything begins.
    Raises RecordError: another process trains this run (75), the folder cannot be made (73), or
    nothing can be written there (74).
    """
    epoch = Epoch(path, os.urandom(8).hex())
    try:
        path.mkdir(parents=True, exist_ok=True)
        handle = _opened(path / LOCK, os.O_RDWR | os.O_CREAT)
    except OSError as error:
        raise _failed("cannot be created", path, error, CANNOT_CREATE) from error
    try:
        try:
            take_lock(handle)
            os.ftruncate(handle, 0)
            os.write(handle, epoch.name.encode())
        except BlockingIOError as error:
            raise RecordError(_message(path, "is in use by another process"), BUSY) from error
        except OSError as error:
            raise _failed("cannot be locked", path, error, CANNOT_WRITE) from error
        remove_leftovers(path)
        yield epoch
    finally:
        os.close(handle)


def take_lock(handle: int) -> bool:
    """Whether an open file is locked now: False where the file system has no locks.

    Raises BlockingIOError if another process holds the lock, OSError for a fault.
    """
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        return False
    return True


def remove_file(path: Path) -> None:
    """Removes the file `path`, if there is one; RecordError (74), such as of a read-only disk."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise _failed("cannot be removed", path, error, CANNOT_WRITE) from error


def sync_file(path: Path) -> None:
    """Makes what was appended to `path`, if there is one, survive a power cut; RecordError (74)."""
    try:
        handle = _opened(path, os.O_RDONLY)
        try:
            _sync(handle)
        finally:
            os.close(handle)
    except FileNotFoundError:
        return
    except OSError as error:
        raise _failed("cannot be written", path, error, CANNOT_WRITE) from error


def sync_folder(path: Path) -> None:
    """Makes a rename in the folder `path` survive a power cut, where its file system can."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        if error.errno in DISK_FAULTS:
            raise
        return
    try:
        _sync(handle)
    finally:
        os.close(handle)


def _sync(handle: int) -> None:
    """An fsync is a comfort that network drives refuse, of folders above all: no fault of ours."""
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno in DISK_FAULTS:
            raise


def _opened(path: Path, flags: int) -> int:
    """A handle of a regular file that is no link; OSError for anything else."""
    # O_NONBLOCK: opening somebody's named pipe must not wait for its other end.
    handle = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise OSError(errno.EINVAL, "it is not a file")
    return handle


def _failed(what: str, path: Path, error: Exception, exit_code: int) -> RecordError:
    reason = error.strerror if isinstance(error, OSError) else None
    return RecordError(_message(path, f"{what}: {reason or error}"), code_of(error, exit_code))


def _message(path: Path, problem: str) -> str:
    return one_line(f"{path}: {problem}")
