"""Records of runs that nobody has begun: made when a plan is, gone when the run is here."""

import os
from contextlib import suppress
from pathlib import Path

from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.records.files import LOCK, remove_file, run_lock
from msgdrop_cli.records.store import RUN, create_run, find_run


def plan_run(path: Path, planned: PlannedRun) -> None:
    """Writes the record of a run that is to be trained later, unless there is one already.

    Raises RecordError as `run_lock` and `create_run` do: nothing is written while others do so.
    """
    with run_lock(path):
        if not os.path.lexists(path / RUN):
            create_run(path, planned, {})


def remove_planned(path: Path, run_id: str) -> None:
    """Removes the folder of a run that is planned and no more; whatever else is there stays.

    Raises RecordError if it is in use (75), damaged (2) or not to be removed (74).
    """
    if not _is_planned(path, run_id):
        return
    with run_lock(path):
        if _is_planned(path, run_id):  # still
            remove_file(path / RUN)
            remove_file(path / LOCK)
    with suppress(OSError):  # not empty: what is left is not ours
        path.rmdir()


def _is_planned(path: Path, run_id: str) -> bool:
    record = find_run(path, run_id)
    return record is not None and record.status == "planned"
