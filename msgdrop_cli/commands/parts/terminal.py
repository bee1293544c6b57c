"""A terminal that is drawn on and whose keys are read, and that is left as it was found."""

import os
import re
import select
import signal
import sys
import termios
import tty
from collections import deque
from contextlib import suppress
from types import FrameType
from typing import TYPE_CHECKING, Any

from msgdrop_cli.report.characters import ASCII, UNICODE, Signs
from msgdrop_cli.signals import heeded, leave

if TYPE_CHECKING:
    from rich.live import Live

_KEY = re.compile(rb"\x1b\[[0-9;]*[A-Za-z~]|\x1bO[A-Z]|.", re.DOTALL)
_NAMES = {"A": "up", "B": "down", "C": "right", "D": "left", "Z": "shift-tab"}
_LEAVE_SCREEN = b"\x1b[?1049l\x1b[?25h\x1b[0m"
GONE = "gone"
"""The key of a terminal that nobody sits at any more."""


def is_terminal() -> bool:
    """Whether stdin and stdout are a terminal that can be drawn on."""
    both = sys.stdin.isatty() and sys.stdout.isatty()
    return both and os.environ.get("TERM", "dumb") not in ("", "dumb", "unknown")


class Terminal:
    """The second screen of the terminal, for the time of a `with` block.

    However the block ends, by a signal, too, the first one comes back, with its cursor and its way
    to read lines; after Ctrl-Z and `fg` the second one does.
    """

    def __init__(self, live: "Live") -> None:
        """live: a `rich.live.Live` with screen=True."""
        self._live, self._input = live, sys.stdin.fileno()
        self._before: list[Any] = []
        self._handlers: dict[signal.Signals, Any] = {}
        self._typed = deque[str]()

    def __enter__(self) -> "Terminal":
        self._before = termios.tcgetattr(self._input)
        try:
            for each in heeded():
                self._handlers[each] = signal.signal(each, self._end)
            self._handlers[signal.SIGTSTP] = signal.signal(signal.SIGTSTP, self._pause)
            tty.setcbreak(self._input)  # Ctrl-C stays a signal
            self._live.start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):
            self._live.stop()
        self._restore(b"")
        for each, handler in self._handlers.items():
            signal.signal(each, handler)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows, as they are now."""
        return self._live.console.size

    @property
    def signs(self) -> Signs:
        """What it can show."""
        return UNICODE if "utf" in self._live.console.encoding else ASCII

    def draw(self, shown: Any) -> None:
        """Show something that rich can show instead of what is there."""
        self._live.update(shown, refresh=True)

    def key(self, seconds: float) -> str | None:
        """The next key within so many seconds: a letter, or a name such as `left`; None without."""
        if not self._typed:
            ready, _, _ = select.select([self._input], [], [], max(0.0, seconds))
            if ready:
                typed = os.read(self._input, 1024)
                self._typed.extend(map(_name, _KEY.findall(typed)) if typed else [GONE])
        return self._typed.popleft() if self._typed else None

    def _restore(self, screen: bytes) -> None:
        """Directly, since we may be in the middle of drawing."""
        with suppress(OSError):
            os.write(sys.__stdout__.fileno() if sys.__stdout__ else 1, screen)
        with suppress(OSError, termios.error):
            termios.tcsetattr(self._input, termios.TCSADRAIN, self._before)

    def _end(self, signum: int, _: FrameType | None) -> None:
        self._restore(_LEAVE_SCREEN)
        leave(signum, b"stopped\n")

    def _pause(self, _signum: int, _: FrameType | None) -> None:
        self._restore(_LEAVE_SCREEN)
        os.kill(os.getpid(), signal.SIGSTOP)  # until `fg`
        with suppress(OSError, termios.error):
            tty.setcbreak(self._input)
        self._live.console.set_alt_screen(True)
        self._live.console.show_cursor(False)


def _name(key: bytes) -> str:
    return (
        _NAMES.get(key[-1:].decode("ascii", "replace"), "")
        if len(key) > 1
        else key.decode("latin-1")
    )
