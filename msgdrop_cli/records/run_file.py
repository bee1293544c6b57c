"""`run.json`: what of it the program relies on, and how it is read."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

from msgdrop_cli.definition.spec import NAME
from msgdrop_cli.definition.strict import Where, build, one_line
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.files import read_json
from msgdrop_cli.records.parsing import LARGEST_NUMBER, RECORD
from msgdrop_cli.records.pretraining import Pretraining

SCHEMA = 1
Status = Literal["planned", "running", "done", "failed", "diverged", "interrupted"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """The part of `run.json` that the program relies on; more may stand there."""

    run_id: str
    variant: str
    label: str
    definition: str
    profile: str
    status: Status
    reason: str | None = None
    overrides: tuple[str, ...] = ()
    registration: str | None = None
    environment: str
    seed: int
    spec: Mapping[str, Any]
    env_steps: int
    wall_time_s: float
    pretraining: Pretraining | None = None

    def __post_init__(self) -> None:
        for key in ("run_id", "variant", "definition", "profile", "environment"):
            if not NAME.fullmatch(getattr(self, key)):
                raise ValueError(f"{key} is not a name")
        if self.env_steps < 0 or self.wall_time_s < 0:
            raise ValueError("env_steps and wall_time_s cannot be negative")
        if self.wall_time_s > LARGEST_NUMBER:
            raise ValueError(f"wall_time_s is beyond {LARGEST_NUMBER:g}")


def read_run(file: Path) -> dict[str, Any]:
    """The whole of a `run.json`, checked; RecordError if it is damaged or of another schema."""
    run = read_json(file, RECORD)
    if not isinstance(run, dict):
        raise RecordError(one_line(f"{file}: is damaged: expected an object"))
    if run.get("schema") != SCHEMA:
        problem = f"schema {str(run.get('schema'))[:20]} is unknown, expected {SCHEMA}"
        raise RecordError(one_line(f"{file}: {problem}; a newer msgdrop may read it"))
    known = {field.name for field in fields(_Run)}
    try:
        build(_Run, {key: run[key] for key in run if key in known}, Where(str(file)))
    except DefinitionError as error:
        raise RecordError(str(error)) from error
    return run
