"""What was computed of finished runs' logs, kept so that thousands of runs are read in seconds.

Kept values are never worth more than the logs: they count only for the very files that they were
made of (size, times and inode), with the very code that made them, and any that is stale, damaged
or missing is silently made anew. `verify` and `publish` ask for none. Writers need no lock: each
file is whole, and who loses a race computes again.
"""

import hashlib
import json
import os
import stat
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from msgdrop_cli.definition.run_id import short_hash
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import read_bytes, write_bytes_atomic
from msgdrop_cli.records.packed import log_file
from msgdrop_cli.records.sources import code

DERIVED = "derived"
"""The folder of these files in a results folder, a file a run."""
LARGEST = 2**20
"""Bytes of such a file; a run of 400 windows has 20,000."""
SETTLED_NS = 2 * 10**9
"""Nanoseconds for which a log must not have changed: a file system's clock may be as coarse."""


class Derived:
    """The values of one run, kept in a results folder; without one as long as the object lives."""

    def __init__(self, home: Path | None, run: Path, logs: tuple[str, ...]) -> None:
        self._home, self._run, self._logs = home, run, logs
        self._values: dict[str, Any] | None = None
        self._made_of: list[int] | None = None

    def begin(self) -> dict[str, Any]:
        """The values so far, and which files the logs are from now on: before any is read."""
        if self._values is None:
            self._made_of = self._facts() if self._home else None
            self._values = self._read()
        return self._values

    def value(self, name: str, make: Callable[[], Any]) -> Any:
        """The JSON value of this name, kept or made."""
        values = self.begin()
        if name not in values:
            values[name] = make()
            self._keep()
        return values[name]

    def _facts(self) -> list[int] | None:
        """Which files the logs are, and as of when; None if that cannot be relied on."""
        facts: list[int] = []
        for log in self._logs:
            try:
                found = os.lstat(log_file(self._run / log))
            except OSError:
                return None
            changed = max(found.st_mtime_ns, found.st_ctime_ns)
            if not stat.S_ISREG(found.st_mode) or changed > time.time_ns() - SETTLED_NS:
                return None
            facts += (found.st_dev, found.st_ino, found.st_size)
            facts += (found.st_mtime_ns, found.st_ctime_ns)
        return facts

    def _file(self, home: Path) -> Path:
        """Where they are kept: runs of one name may lie in several places."""
        within = short_hash({"run": os.path.relpath(self._run, home)})
        return home / DERIVED / f"{self._run.name}-{within}.json"

    def _read(self) -> dict[str, Any]:
        """What this very code has kept of these very logs; the rest makes room."""
        if self._home is None or self._made_of is None:
            return {}
        try:
            digest, _, content = read_bytes(self._file(self._home), LARGEST).partition(b"\n")
            if hashlib.sha256(content).hexdigest().encode() == digest:
                made_by, made_of, values = json.loads(content)
                if (made_by, made_of) == (code(), self._made_of):
                    return dict(values)
        except (RecordError, ValueError, TypeError, RecursionError):
            pass
        return {}

    def _keep(self) -> None:
        """Write all values down, if the logs are still what they were; a fault loses nothing."""
        if self._home is None or self._made_of is None or self._facts() != self._made_of:
            return
        content = json.dumps([code(), self._made_of, self._values]).encode()
        file = self._file(self._home)
        if len(content) > LARGEST - 65 or file.parent.is_symlink():
            return
        digest = hashlib.sha256(content).hexdigest().encode()
        with suppress(OSError, RecordError):  # a folder that is not ours: made again next time
            file.parent.mkdir(exist_ok=True)
            write_bytes_atomic(file, digest + b"\n" + content, durable=False)
