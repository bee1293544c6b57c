"""Whether joblib can start workers here: in a process of its own, while the others look."""

import subprocess
import sys
from pathlib import Path

from msgdrop_cli.commands.parts.doctor.check import Check, Found, fine, mend

_PROGRAM = (
    "from joblib import Parallel, delayed; print(Parallel(2)(delayed(abs)(-n) for n in (1, 2)))"
)
_WITHIN_S = 20.0


def start() -> Check:
    """Begin, and return the check that waits for what comes of it."""
    nothing, pipe = subprocess.DEVNULL, subprocess.PIPE
    process = subprocess.Popen(
        [sys.executable, "-c", _PROGRAM], stdin=nothing, stdout=pipe, stderr=pipe, text=True
    )

    def look(_: Path) -> Found:
        try:
            said, error = process.communicate(timeout=_WITHIN_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            return mend(f"none answers within {_WITHIN_S:.0f} s", "take --workers 1")
        if said.strip() != "[1, 2]":
            last = (error.splitlines() or ["no word"])[-1]
            return mend(f"joblib starts none: {last}", "take --workers 1")
        return fine("joblib starts them")

    return Check(name="workers", look=look)
