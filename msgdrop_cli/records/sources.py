"""Which code computes numbers from logs: what was kept by any other is made anew."""

import hashlib
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

_ROOMS = ("analysis", "definition", "records")
"""Who reads logs, who says what the entries in them mean, and who computes."""


@cache
def code() -> str:
    """A digest of all that stands between a log and a number, and of the Python that adds up."""
    digest = hashlib.sha256(sys.version.encode())
    for file in code_files():
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def code_files() -> list[Path]:
    """The sources that decide what is computed."""
    package = Path(__file__).parents[1]
    files = [file for room in _ROOMS for file in sorted((package / room).glob("*.py"))]
    if (metric := find_spec("msgdrop_envs.metric")) and metric.origin:
        files.append(Path(metric.origin))
    return files
