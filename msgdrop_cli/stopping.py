"""How work is stopped: the first signal asks everybody to write checkpoints, the second is the end.

Whoever is asked looks at `Control` about twice a second, in this process or in a worker. Who says
nothing for PATIENCE_S is given up; who says that it writes is waited for, since that is worth more.
"""

import ctypes
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from msgdrop_cli.errors import RunError
from msgdrop_cli.signals import heeded, leave

PATIENCE_S = 10.0
LOOK_AGAIN_S = 2.0
WRITING, NOTHING = "writing", "nothing"
"""Phases of a run that heeds the stop, and of one with which nothing is done any more."""
_NOT_ASKED, _ASKED = b"0", b"1"
_CLOSE_ON_EXEC = 1


class Stopped(Exception):
    """The user (or the machine) asked us to stop, and everything is written."""

    def __init__(self, signum: int) -> None:
        super().__init__(f"stopped by signal {signum}")
        self.signal = signum


class Unanswered(BaseException):
    """Raised where the main thread waits for work: somebody was asked to stop and is silent."""


@dataclass(slots=True)
class Control:
    """How this process and its workers talk: stop, and who is at what.

    It is a file: a byte that says stop, then lines of `run_id phase`. For workers of this machine
    it is one in memory: it has no name and lives as long as its owner; they find it below /proc. So
    nothing can clean it away, fill it up, or leave it behind. (`cluster/control.py` has another.)
    """

    path: Path
    """Where the owner and its workers open it."""
    descriptor: int
    """The owner's."""
    signal: int | None = None
    """The signal that asked us to stop; known to the owner only."""
    waiting: bool = False
    """Whether the main thread waits for work that may be given up."""
    given_up: bool = False

    def ask(self, asked: bool = True) -> None:
        """Ask everybody to stop, or take it back; for the owner."""
        os.pwrite(self.descriptor, _ASKED if asked else _NOT_ASKED, 0)

    def stopping(self) -> bool:
        """Whether everybody should write checkpoints and return."""
        try:
            with self.path.open("rb", buffering=0) as file:
                return file.read(1) == _ASKED
        except FileNotFoundError:
            return True  # the owner has gone: nobody waits for the work

    def mark(self, run_id: str, phase: str) -> None:
        """Note, for the display and for the patience, what a worker does with this run."""
        with suppress(OSError), self.path.open("ab", buffering=0) as file:
            file.write(f"{run_id} {phase}\n".encode())

    def phases(self) -> dict[str, str]:
        """What is done with each run that is at work."""
        with suppress(OSError):
            lines = self.path.read_text().splitlines()[1:]
            # Several machines may write at one place of a network drive: a line is lost then.
            last = dict(line.split(" ", 1) for line in lines if " " in line)
            return {run_id: phase for run_id, phase in last.items() if phase != NOTHING}
        return {}

    def writing(self) -> bool:
        """Whether somebody heeds the stop just now."""
        return WRITING in self.phases().values()


@contextmanager
def in_memory() -> Iterator[Control]:
    """The control of a command and its workers on this machine."""
    # Not os.memfd_create: Pythons that were built for old systems lack it.
    descriptor = ctypes.CDLL(None, use_errno=True).memfd_create(b"msgdrop", _CLOSE_ON_EXEC)
    if descriptor < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    try:
        control = Control(Path(f"/proc/{os.getpid()}/fd/{descriptor}"), descriptor)
        if not control.path.exists():
            raise RunError("/proc is missing: workers are told through it when to stop; mount it")
        os.write(descriptor, _NOT_ASKED + b"\n")
        yield control
    finally:
        os.close(descriptor)


@contextmanager
def graceful_stop(
    made: Callable[[], AbstractContextManager[Control]] = in_memory,
) -> Iterator[Control]:
    """Turns the first signal into a request to stop, the second into the end.

    After PATIENCE_S `Unanswered` is raised where the main thread is `waiting`, unless somebody
    writes; if that does not end it, it is the end. made: what makes the control.
    """
    with made() as control:

        def asked(signum: int, _: FrameType | None) -> None:
            if control.signal is not None:
                leave(signum)
            control.signal = signum
            control.ask()
            signal.setitimer(signal.ITIMER_REAL, PATIENCE_S, LOOK_AGAIN_S)

        def overdue(_signum: int, _: FrameType | None) -> None:
            if control.signal is None or not control.waiting or control.writing():
                return  # we look again soon
            if control.given_up:
                leave(control.signal)
            control.given_up = True
            raise Unanswered

        handlers = dict.fromkeys(heeded(), asked) | {signal.SIGALRM: overdue}
        before = {each: signal.signal(each, handler) for each, handler in handlers.items()}
        try:
            yield control
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            for each, handler in before.items():
                signal.signal(each, handler)
