"""JSON files and logs that survive kill -9, full disks and other people's files.

What is read was perhaps written by somebody else: any damage is a RecordError of one line, and
texts come back without control characters.
"""

import fcntl
import json
import math
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError

CANNOT_READ, CANNOT_CREATE, CANNOT_WRITE, BUSY = 2, 73, 74, 75
LARGEST_FILE = 256 * 2**20
_LARGEST_INT = 2**63 - 1
LOCK = "lock"
"""The file of a run folder that whoever writes there holds."""
TEMPORARY = ".tmp-"
"""Begins the names of files and folders that are being written."""


def write_json_atomic(path: Path, value: Any, *, durable: bool = True) -> None:
    """Replaces `path` by `value` as JSON: a reader sees the old file or the new one, never a part.

    `durable=False` leaves out the fsyncs: for what is only shown to people.
    Raises RecordError (74), the old file intact; ValueError for NaN, a mistake of the caller.
    """
    text = json.dumps(value, indent=2, allow_nan=False) + "\n"
    write_bytes_atomic(path, text.encode(), durable=durable)


def write_jsonl_atomic(path: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Replaces the log `path` by these rows, as `write_json_atomic` does."""
    lines = (json.dumps(row, allow_nan=False) + "\n" for row in rows)
    write_bytes_atomic(path, "".join(lines).encode())


def write_bytes_atomic(path: Path, content: bytes, *, durable: bool = True) -> None:
    """Replaces `path` by `content`, whole or not at all; raises RecordError (74)."""
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(prefix=TEMPORARY, dir=path.parent)
        temporary = Path(name)
        with os.fdopen(handle, "wb") as file:
            os.fchmod(handle, 0o644)  # mkstemp makes it private
            file.write(content)
            file.flush()
            if durable:
                os.fsync(handle)
        temporary.replace(path)
        if durable:
            sync_folder(path.parent)
    except OSError as error:
        if temporary is not None:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
        raise _failed("cannot be written", path, error, CANNOT_WRITE) from error


def append_jsonl(path: Path, *rows: Mapping[str, Any], durable: bool = True) -> None:
    """Appends the rows in one write, and all of them or none.

    `durable=False` leaves out the fsync, for who calls `sync_file` before anything counts on them.
    A log that a killed process left torn has to be cut (`cut_jsonl`) before it is appended to.
    Raises RecordError (74); ValueError for NaN, a mistake of the caller.
    """
    content = "".join(json.dumps(row, allow_nan=False) + "\n" for row in rows).encode()
    try:
        handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        try:
            before = os.fstat(handle).st_size
            try:
                if os.write(handle, content) < len(content):
                    raise OSError(0, "the disk took only a part")
                if durable:
                    os.fsync(handle)
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
    if keep == 0 and not path.exists():
        return
    lines = _whole_lines(read_bytes(path))
    if len(lines) < keep:
        raise RecordError(_message(path, f"expected {keep} rows, only {len(lines)} are whole"))
    try:
        with path.open("r+b") as file:
            file.truncate(sum(len(line) + 1 for line in lines[:keep]))
            os.fsync(file.fileno())
    except OSError as error:
        raise _failed("cannot be written", path, error, CANNOT_WRITE) from error


def count_jsonl(path: Path) -> int:
    """Whole rows in the log `path`, 0 for a missing one; RecordError (2) if it is no file."""
    return len(_whole_lines(read_bytes(path))) if path.exists() else 0


def read_json(path: Path) -> Any:
    """The value in `path`, strings without control characters; RecordError if it is damaged."""
    return parse_json(read_bytes(path), str(path))


def parse_jsonl(content: bytes, place: str) -> list[dict[str, Any]]:
    """The rows of a log. A last line without its end was torn by a crash and is left out.

    Raises RecordError, naming `place` and the line, for every other damage.
    """
    rows = []
    for number, line in enumerate(_whole_lines(content), start=1):
        row = parse_json(line, f"{place}: line {number}")
        if not isinstance(row, dict):
            raise RecordError(one_line(f"{place}: line {number}: expected an object"))
        rows.append(row)
    return rows


def parse_json(content: bytes, place: str) -> Any:
    """The value in `content`, as `read_json`; `place` begins the error's line."""
    try:
        return _cleaned(
            json.loads(
                content.decode(),
                parse_float=_finite,
                parse_int=_64_bits,
                parse_constant=_refuse_constant,
            )
        )
    except (ValueError, RecursionError) as error:
        raise RecordError(one_line(f"{place}: is damaged: {error}")) from error


@contextmanager
def run_lock(path: Path) -> Iterator[None]:
    """Holds the kernel's lock of the run folder `path`, which is made if need be.

    The lock goes with the process, however it ends; there is nothing to clean up.
    Raises RecordError: another process trains this run (75), or the folder cannot be made (73).
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        handle = os.open(path / LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
    except OSError as error:
        raise _failed("cannot be created", path, error, CANNOT_CREATE) from error
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RecordError(_message(path, "is in use by another process"), BUSY) from error
        except OSError as error:
            raise _failed("cannot be locked", path, error, CANNOT_WRITE) from error
        _remove_leftovers(path)
        yield
    finally:
        os.close(handle)


def _remove_leftovers(path: Path) -> None:
    """Removes what a killed process had not yet renamed; only the lock's holder writes here."""
    for leftover in path.glob(f"{TEMPORARY}*"):
        with suppress(OSError):
            leftover.unlink()


def read_bytes(path: Path, largest: int = LARGEST_FILE) -> bytes:
    """The bytes of a regular file that is no link and has at most `largest` bytes.

    Raises RecordError (2) for any other file.
    """
    try:
        # O_NONBLOCK: opening somebody's named pipe must not wait for a writer.
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            facts = os.fstat(handle)
            if not stat.S_ISREG(facts.st_mode) or facts.st_size > largest:
                raise RecordError(_message(path, "is not a record of msgdrop"))
            with os.fdopen(handle, "rb", closefd=False) as file:
                return file.read()
        finally:
            os.close(handle)
    except (OSError, ValueError) as error:
        raise _failed("cannot be read", path, error, CANNOT_READ) from error


def _whole_lines(content: bytes) -> list[bytes]:
    """The lines that end; what follows the last end is torn."""
    return content.split(b"\n")[:-1]


def _cleaned(value: Any) -> Any:
    if isinstance(value, str):
        return one_line(value)
    if isinstance(value, list):
        return [_cleaned(entry) for entry in value]
    if isinstance(value, dict):
        return {one_line(key): _cleaned(entry) for key, entry in value.items()}
    return value


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:20]} is not finite")
    return number


def _64_bits(text: str) -> int:
    if len(text) > 20 or abs(number := int(text)) > _LARGEST_INT:
        raise ValueError(f"{text[:20]} is a number beyond 64 bits")
    return number


def _refuse_constant(text: str) -> float:
    raise ValueError(f"{text} is not JSON")


def sync_file(path: Path) -> None:
    """Makes what was appended to `path`, if there is one, survive a power cut; RecordError (74)."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
    except FileNotFoundError:
        return
    except OSError as error:
        raise _failed("cannot be written", path, error, CANNOT_WRITE) from error


def sync_folder(path: Path) -> None:
    """Makes a rename in the folder `path` survive a power cut."""
    handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _failed(what: str, path: Path, error: Exception, exit_code: int) -> RecordError:
    reason = error.strerror if isinstance(error, OSError) else None
    return RecordError(_message(path, f"{what}: {reason or error}"), exit_code)


def _message(path: Path, problem: str) -> str:
    return one_line(f"{path}: {problem}")
