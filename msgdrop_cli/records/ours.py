"""What is ours in a results folder, which may have come from somebody else.

No link in it is followed where we write or delete, and only names that are ours are deleted.
"""

import re
import shutil
from collections.abc import Container, Iterable
from contextlib import suppress
from pathlib import Path

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import CANNOT_CREATE, run_lock
from msgdrop_cli.records.listings import listed
from msgdrop_cli.records.store import PROGRESS, RunRecord
from msgdrop_cli.records.temporary import TEMPORARY

CHECKPOINTS, REPLAY = "checkpoints", "replay"
"""The folder of a run's checkpoints, and the one in it of their replay memory."""
STEPS = re.compile(r"\d{15}")
"""The name of a checkpoint: its env steps."""
SEGMENT = re.compile(r"(\d{15})-(\d{15})(?:-\d{15})?\.safetensors")
"""The name of a stretch of the replay memory: its first step, the first one after it, and when it
was written, so that two checkpoints never give one name (the first ones left this out)."""


def refuse_links(root: Path, path: Path) -> None:
    """Raises RecordError (73) if `path`, or a folder on the way to it from `root`, is a link.

    `root` is what the user has named, and may be one.
    """
    place = root
    for name in path.relative_to(root).parts:
        place /= name
        if place.is_symlink():
            problem = "is a symbolic link, and nothing is written through one; put a folder there"
            raise RecordError(one_line(f"{place}: {problem}"), CANNOT_CREATE)


def delete_checkpoints(run_path: Path, keep: Container[Path] = ()) -> None:
    """Deletes the files of a run's checkpoints that are not in `keep`; its lock must be held.

    What cannot be deleted stays. Raises RecordError if a link stands for one of the folders (73),
    or if one cannot be read (2).
    """
    folder = run_path / CHECKPOINTS
    refuse_links(run_path, folder / REPLAY)
    for place, ours in ((folder / REPLAY, SEGMENT), (folder, STEPS)):
        for path in listed(place):
            is_ours = ours.fullmatch(path.name) or path.name.startswith(TEMPORARY)
            if is_ours and path not in keep:
                _delete(path)
        with suppress(OSError):  # something is left in it
            place.rmdir()


def delete_leftovers(records: Iterable[RunRecord]) -> None:
    """Deletes what a kill left of finished runs: checkpoints, progress, what was being written.

    A run at which somebody is at work, or that cannot be read or written to, stays as it is.
    """
    for record in records:
        names = (CHECKPOINTS, PROGRESS, f"{TEMPORARY}*")
        with suppress(RecordError):
            if record.status == "done" and any(listed(record.path, name) for name in names):
                with run_lock(record.path):  # sees to what was being written
                    delete_checkpoints(record.path)
                    _delete(record.path / PROGRESS)


def _delete(path: Path) -> None:
    """Deletes a file, a link, or a folder with all that is in it."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()
