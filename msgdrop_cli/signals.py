"""Signals that end the program, and what it leaves behind then.

Outside of training and evaluation (`stopping.py`) a signal ends it at once: what is on disk is
whole at any time. What was ignored at the start (`nohup`, `command &` in a script) stays ignored.
Loads next to nothing: until its handlers are there, Ctrl-C is a traceback.
"""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress

TYPE_CHECKING = False
"""Not typing's, which takes longer to load than everything here."""
if TYPE_CHECKING:
    from pathlib import Path
    from types import FrameType
    from typing import NoReturn

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_PREFIX = "msgdrop-scratch-"
_SURELY_LOCKED_S = 60.0
"""Nobody takes that long from making a scratch folder to locking it."""
_scratch = set[str]()
_looked_through = set["tuple[Path, str]"]()


def end_at_once() -> None:
    """From now on a signal ends the program, with a word.

    Not by an exception: within an import torch makes an ImportError of it, and others swallow it.
    """
    for each in heeded():
        signal.signal(each, _end)


def heeded() -> list[signal.Signals]:
    """The signals that nobody has told this process to ignore."""
    return [each for each in SIGNALS if signal.getsignal(each) is not signal.SIG_IGN]


@contextmanager
def held_back() -> Iterator[None]:
    """Processes that are started in the block never get a signal; this thread does after it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def scratch_folder(parent: "Path | None" = None, prefix: str = _PREFIX) -> Iterator["Path"]:
    """A temporary folder that goes with the block, or with the signal that ends the program.

    parent: $TMPDIR if None. What a kill has left there of earlier ones is removed, too.
    """
    import fcntl
    from pathlib import Path
    from tempfile import TemporaryDirectory

    with TemporaryDirectory(dir=parent, prefix=prefix) as name:
        handle = os.open(name, os.O_RDONLY)
        _scratch.add(name)
        try:
            with suppress(OSError):  # some network drives have no locks
                fcntl.flock(handle, fcntl.LOCK_SH)  # goes with this process, however it ends
            if (place := (Path(name).parent, prefix)) not in _looked_through:
                _looked_through.add(place)  # once: it may hold thousands of things
                _remove_abandoned(Path(name), prefix)
            yield Path(name)
        finally:
            _scratch.discard(name)
            os.close(handle)


def _remove_abandoned(ours: "Path", prefix: str) -> None:
    """Remove our user's older scratch folders beside `ours` that no process holds."""
    import fcntl
    from shutil import rmtree

    now = ours.stat().st_mtime  # by the clock of the file system
    for folder in ours.parent.glob(f"{prefix}*"):
        with suppress(OSError):
            handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                facts = os.fstat(handle)
                if facts.st_uid == os.getuid() and now - facts.st_mtime > _SURELY_LOCKED_S:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    rmtree(folder)
            finally:
                os.close(handle)


def leave(signum: int, words: bytes = b"") -> "NoReturn":
    """End here and now: workers die with us, and an interrupted file operation leaves the old file.

    stderr is written to directly, since we may be in the middle of a line of it.
    """
    with suppress(OSError):
        # Below the ^C of a terminal, with the cursor that a progress display hides.
        os.write(2, (b"\x1b[?25h\n" if os.isatty(2) else b"") + words)
    if _scratch:
        from shutil import rmtree

        for name in tuple(_scratch):
            rmtree(name, ignore_errors=True)
    os._exit(128 + signum)


def _end(signum: int, _: "FrameType | None") -> None:
    leave(signum, b"stopped\n")
