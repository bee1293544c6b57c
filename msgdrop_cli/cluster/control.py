"""How a command tells workers on other machines to stop, and how they know that it lives."""

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from msgdrop_cli.records.temporary import TEMPORARY
from msgdrop_cli.signals import scratch_folder
from msgdrop_cli.stopping import Control

_BEAT_S = 5.0
_SILENCE_S = 120.0
"""Workers stop with a checkpoint if the command that began them has been silent for so long."""
SILENT = "000000000\n"
"""What stands in a control of which nobody has asked anything: no stop, and no number yet."""


@dataclass(slots=True)
class SharedControl(Control):
    """A control that workers on other machines find in the results folder.

    The owner writes a number behind the first byte again and again: a file does not go with its
    process as memory does, and nobody waits for work whose owner was killed.
    """

    heard: str | None = None
    """The first line as it was last read; None, until it is."""
    since: float = 0.0
    """When the number was last a new one, by this process's own clock."""

    def __reduce__(self) -> tuple[type["SharedControl"], tuple[Path, int]]:
        """Whoever gets it has heard nothing yet: machines' clocks do not begin at one time."""
        return SharedControl, (self.path, -1)

    def beat(self, number: int) -> None:
        """Say that the owner lives."""
        os.pwrite(self.descriptor, f"{number:08}".encode(), 1)

    def stopping(self) -> bool:
        """Whether everybody should write checkpoints and return."""
        try:
            line = self.path.read_text().partition("\n")[0]
        except OSError:
            return True
        if line != self.heard:
            self.heard, self.since = line, time.monotonic()
        return line[:1] == "1" or time.monotonic() - self.since > _SILENCE_S


@contextmanager
def shared_control(root: Path) -> Iterator[Control]:
    """A control in the results folder, which goes with this context."""
    with scratch_folder(root, TEMPORARY) as folder:
        yield from _beating(folder / "control")


def _beating(path: Path) -> Iterator[Control]:
    """A control that is told again and again that its owner lives."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    over = threading.Event()
    control = SharedControl(path, descriptor)

    def beat() -> None:
        number = 0
        while not over.wait(_BEAT_S):
            number += 1
            with suppress(OSError):  # a drive that is gone for a moment
                control.beat(number)

    thread = threading.Thread(target=beat, daemon=True)
    try:
        os.write(descriptor, SILENT.encode())
        thread.start()
        yield control
    finally:
        over.set()
        if thread.ident:
            thread.join()
        os.close(descriptor)
