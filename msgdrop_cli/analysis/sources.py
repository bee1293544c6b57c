"""Which code computes numbers from logs: what was kept by any other is made anew."""

import hashlib
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from msgdrop_cli import records


@cache
def code() -> str:
    """A digest of all that stands between a log and a number, and of the Python that adds up."""
    digest = hashlib.sha256(sys.version.encode())
    folders = (Path(__file__).parent, *map(Path, records.__path__))
    files = [file for folder in folders for file in sorted(folder.glob("*.py"))]
    if (metric := find_spec("msgdrop_envs.metric")) and metric.origin:
        files.append(Path(metric.origin))
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
