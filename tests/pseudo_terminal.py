"""A process at a terminal of its own, as somebody who types sees it."""

import fcntl
import os
import pty
import select
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tests.cli_runs import ROOT

ENTERED, LEFT = b"\x1b[?1049h", b"\x1b[?1049l"
"""What a terminal is told to show its second screen, and its first one again."""
_BEGIN = """
import fcntl, os, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
"""


class Terminal:
    """The side of a terminal that somebody sits at."""

    def __init__(self, handle: int, process: "subprocess.Popen[bytes]") -> None:
        self._handle, self.process = handle, process
        self.seen = b""
        """Everything that was written on it."""

    def type(self, keys: str) -> None:
        """Press keys."""
        os.write(self._handle, keys.encode())

    def wait_for(self, text: str | bytes, seconds: float = 40.0) -> None:
        """Read until a text is there that was not there before."""
        wanted = text.encode() if isinstance(text, str) else text
        start, end = len(self.seen), time.monotonic() + seconds
        while wanted not in self.seen[start:]:
            assert self._read(end - time.monotonic()), f"{text!r} is not in {self.seen[start:]!r}"

    def ended(self) -> int:
        """Read to the end; the exit code, as shells count."""
        end = time.monotonic() + 20.0
        while self.process.poll() is None and time.monotonic() < end:
            self._read(0.05)
        while self._read(0.0):
            pass
        code = self.process.wait(1.0)
        return 128 - code if code < 0 else code

    def modes(self) -> list[Any]:
        """How it reads: line by line, with an echo, or not."""
        return termios.tcgetattr(self._handle)[:4]

    def _read(self, seconds: float) -> bytes:
        ready, _, _ = select.select([self._handle], [], [], max(0.0, seconds))
        try:
            read = os.read(self._handle, 65_536) if ready else b""
        except OSError:  # nobody holds the other side any more
            read = b""
        self.seen += read
        return read


@contextmanager
def at_a_terminal(*arguments: str, columns: int = 80, rows: int = 24) -> Iterator[Terminal]:
    """Run Python on the checkout at a terminal of this size."""
    outer, inner = pty.openpty()
    fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
    with subprocess.Popen(
        [sys.executable, "-c", _BEGIN, *arguments],
        stdin=inner,
        stdout=inner,
        stderr=inner,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": paths, "TERM": "xterm-256color"},
    ) as process:
        os.set_blocking(outer, True)
        try:
            yield Terminal(outer, process)
        finally:
            process.kill()
            os.close(inner)
            os.close(outer)
