"""What a worker does that does not see the results folder: it has one of its own for each task."""

import os
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from msgdrop_cli.cluster.control import SILENT, SharedControl
from msgdrop_cli.cluster.parcels import Parcel, open_parcel, parcel
from msgdrop_cli.cluster.shared import work_there
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import read_json, run_lock
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.store import PROGRESS
from msgdrop_cli.scheduler import Task
from msgdrop_cli.stopping import WRITING

if TYPE_CHECKING:
    from distributed import Worker

_CONTROL = "control"
_ONE_MAKES_IT = threading.Lock()
"""The task and the owner's first word come at the same time, to two threads of the worker: neither
may find a control in which nothing stands yet."""


def work_apart(
    task: Task, parcels: Mapping[str, Parcel], session: str
) -> list[tuple[Outcome, Parcel]]:
    """Unpack the runs of a task, do it, and give back how each ended and what it has become."""
    from distributed import get_worker

    home = _home(get_worker(), session)
    with TemporaryDirectory(dir=home, ignore_cleanup_errors=True) as name:
        task = replace(task, root=Path(name))
        for run_id, files in parcels.items():
            with run_lock(task.folders[run_id]):
                open_parcel(files, task.folders[run_id])
        control = SharedControl(home / _CONTROL, -1)
        outcomes = work_there(task, control)
        for outcome in outcomes:
            if outcome.status == "interrupted":  # its checkpoint is still to come home
                control.mark(outcome.run_id, WRITING)
        return [(outcome, parcel(task.folders[outcome.run_id])) for outcome in outcomes]


def hear(session: str, line: str, dask_worker: "Worker") -> tuple[dict[str, str], dict[str, Any]]:
    """Take the owner's word (stop, and that it lives); say who is at what here, and how far."""
    home = _home(dask_worker, session)
    control = SharedControl(home / _CONTROL, os.open(home / _CONTROL, os.O_RDWR))
    try:
        os.pwrite(control.descriptor, line.encode(), 0)
    finally:
        os.close(control.descriptor)
    progress = {}
    for file in home.glob(f"*/runs/*/*/{PROGRESS}"):
        with suppress(RecordError):  # it goes when a run ends
            progress[file.parent.name.rpartition("-")[2]] = read_json(file)
    return control.phases(), progress


def forget(session: str, dask_worker: "Worker") -> None:
    """The command has ended: whoever is still at its work stops."""
    rmtree(_home(dask_worker, session), ignore_errors=True)


def _home(worker: "Worker", session: str) -> Path:
    """Where this worker keeps what belongs to one command; there is a control in it."""
    home = Path(worker.local_directory) / f"msgdrop-{session}"
    control = home / _CONTROL
    with _ONE_MAKES_IT:
        home.mkdir(parents=True, exist_ok=True)
        if not control.exists():
            control.write_text(SILENT)
    return home
