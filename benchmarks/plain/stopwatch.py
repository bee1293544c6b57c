"""Where the time goes."""

import time

PARTS = ("act", "step", "sample", "update")
"""Choosing actions, the game and storing, putting minibatches together, learning."""


class Stopwatch:
    """Adds up the seconds that each part takes."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(PARTS, 0.0)
        self.last = time.perf_counter()

    def lap(self, part: str) -> None:
        """Add the time since the last lap to a part."""
        now = time.perf_counter()
        self.seconds[part] += now - self.last
        self.last = now
