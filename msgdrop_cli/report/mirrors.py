"""Other people's dashboards, to each of which a run's rows can be copied; all optional extras.

None of them is ever read: what is shown there can be made again from the records.
"""

import os
from collections.abc import Mapping
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from msgdrop_cli.errors import DefinitionError, to_install

if TYPE_CHECKING:
    from msgdrop_cli.records.store import RunRecord

PROJECT = "msgdrop"


class Mirror(Protocol):
    """Where rows are copied to."""

    def __init__(self, into: Path) -> None:
        """into: the folder for what it keeps on this machine."""

    def add(self, record: "RunRecord", step: int, values: Mapping[str, float], at_s: float) -> None:
        """Add a row of a run; step: env steps, at_s: seconds of its training."""

    def flush(self) -> None:
        """Let everybody see what has been added."""

    def close(self, record: "RunRecord") -> None:
        """Nothing more is added to this run for now."""


class TensorBoard:
    """Event files, one folder a run: `tensorboard --logdir INTO`."""

    def __init__(self, into: Path) -> None:
        _needed("tensorboard")
        self._into = into
        self._writers: dict[str, Any] = {}

    def add(self, record: "RunRecord", step: int, values: Mapping[str, float], at_s: float) -> None:
        """One event with a scalar a value."""
        from tensorboard.compat.proto.event_pb2 import Event
        from tensorboard.compat.proto.summary_pb2 import Summary
        from tensorboard.summary.writer.event_file_writer import EventFileWriter

        if record.run_id not in self._writers:
            folder = self._into / record.environment / record.path.resolve().name
            self._writers[record.run_id] = EventFileWriter(str(folder))
        scalars = [Summary.Value(tag=tag, simple_value=each) for tag, each in values.items()]
        event = Event(wall_time=_began(record) + at_s, step=step, summary=Summary(value=scalars))
        self._writers[record.run_id].add_event(event)

    def flush(self) -> None:
        """To the disk, where a TensorBoard that runs sees it."""
        for writer in self._writers.values():
            writer.flush()

    def close(self, record: "RunRecord") -> None:
        """Close the run's file."""
        if writer := self._writers.pop(record.run_id, None):
            writer.close()


class WandB:
    """Weights & Biases: offline unless WANDB_MODE says otherwise; `wandb sync` sends it later."""

    def __init__(self, into: Path) -> None:
        self._library = _needed("wandb")
        self._into = into
        self._runs: dict[str, Any] = {}

    def add(self, record: "RunRecord", step: int, values: Mapping[str, float], at_s: float) -> None:
        """One step of the run that is called like ours."""
        if record.run_id not in self._runs:
            self._into.mkdir(parents=True, exist_ok=True)
            self._runs[record.run_id] = self._library.init(
                project=os.environ.get("WANDB_PROJECT", PROJECT),
                id=record.run_id,
                name=record.path.resolve().name,
                group=record.definition,
                config=record.spec,
                dir=str(self._into),
                mode=os.environ.get("WANDB_MODE", "offline"),
                resume="allow",
                reinit="create_new",
                settings=self._library.Settings(silent=True),
            )
        self._runs[record.run_id].log(dict(values), step=step)

    def flush(self) -> None:
        """It does so by itself."""

    def close(self, record: "RunRecord") -> None:
        """Finish the run."""
        if run := self._runs.pop(record.run_id, None):
            run.finish()


class Trackio:
    """trackio: a database on this machine, TRACKIO_DIR or INTO; `trackio show` opens it."""

    def __init__(self, into: Path) -> None:
        os.environ.setdefault("TRACKIO_DIR", str(into.absolute()))  # read when it is imported
        self._library = _needed("trackio")
        self._runs: dict[str, Any] = {}

    def add(self, record: "RunRecord", step: int, values: Mapping[str, float], at_s: float) -> None:
        """One step of the run that is called like ours."""
        if record.run_id not in self._runs:
            self._runs[record.run_id] = self._library.init(
                project=PROJECT,
                name=record.path.resolve().name,
                group=record.definition,
                config=record.spec,
                resume="allow",
                embed=False,
            )
        self._runs[record.run_id].log(dict(values), step=step)

    def flush(self) -> None:
        """It does so by itself."""

    def close(self, record: "RunRecord") -> None:
        """Finish the run."""
        if run := self._runs.pop(record.run_id, None):
            run.finish()


MIRRORS: dict[str, type[Mirror]] = {"tensorboard": TensorBoard, "wandb": WandB, "trackio": Trackio}
"""By the names of `--to`, which are those of their packages and of our extras."""


def _needed(package: str) -> Any:
    try:
        return import_module(package)
    except ImportError:
        problem = f"--to {package}: is not installed"
        raise DefinitionError(f"{problem}; {to_install(package)}") from None


def _began(record: "RunRecord") -> float:
    """When the run was made, in seconds since 1970; 0 if its record does not say so."""
    try:
        return datetime.fromisoformat(str(record.run.get("created"))).timestamp()
    except ValueError:
        return 0.0
