"""What reference policies get in a game: `references/<environment>-<id>.json`, played once.

The id is of the environment's settings, so a game with other rules has numbers of its own.
"""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from errno import ELOOP
from pathlib import Path
from typing import Any

from msgdrop_cli.definition.run_id import short_hash
from msgdrop_cli.definition.strict import Where, build, one_line
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.files import CANNOT_CREATE, read_json, write_json_atomic
from msgdrop_cli.records.folders import DEEPEST
from msgdrop_cli.records.listings import scanned
from msgdrop_cli.records.parsing import LARGEST_NUMBER
from msgdrop_cli.records.store import RUNS

REFERENCES = "references"
"""The folder of these files in a results folder."""
_MOST = 32
"""Policies of a game, metrics of a policy; real ones have 3 and 5."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """One policy that learns nothing."""

    meaning: str
    metrics: Mapping[str, float | None]
    """The environment's metrics by name; None where there was nothing to divide by."""

    def __post_init__(self) -> None:
        if not 1 <= len(self.metrics) <= _MOST:
            raise ValueError(f"expected 1 to {_MOST} metrics")
        for name, value in self.metrics.items():
            if value is not None and abs(value) > LARGEST_NUMBER:
                raise ValueError(f"{name} is beyond {LARGEST_NUMBER:g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class References:
    """The reference policies of one game."""

    episodes: int
    """Episodes of each policy."""
    seed: int
    commit: str | None
    policies: Mapping[str, Policy]

    def __post_init__(self) -> None:
        if self.episodes < 1 or not 1 <= len(self.policies) <= _MOST:
            raise ValueError(f"expected at least one episode, and 1 to {_MOST} policies")


def game_key(environment: Mapping[str, Any]) -> str:
    """The name of a game and an id of its settings; `environment` is that table of a spec."""
    return f"{environment.get('name')}-{short_hash(environment)}"


def find_references(root: Path, key: str) -> References | None:
    """What is kept for a game in or below `root`, or None.

    Raises RecordError if every file that should say it is damaged.
    """
    damage: RecordError | None = None
    for file in _files(root, f"{key}.json"):
        try:
            return read_references(read_json(file), str(file))
        except RecordError as error:
            damage = error
    if damage is not None:
        raise damage
    return None


def _files(folder: Path, name: str, deepest: int = DEEPEST) -> Iterator[Path]:
    """Files of this name in the folders of references in or below `folder`; runs have none."""
    with suppress(OSError):
        for entry in sorted(scanned(folder), key=lambda each: each.name):
            if entry.name == name and folder.name == REFERENCES:
                yield folder / name
            hidden = entry.name.startswith(".")
            goes_on = deepest and not hidden and entry.name != RUNS
            if goes_on and entry.is_dir(follow_symlinks=False):
                yield from _files(folder / entry.name, name, deepest - 1)


def read_references(table: Any, where: str) -> References:
    """Check what `engine.references.play_references` made; RecordError, naming `where`.

    As in `run.json`, more may stand there than the program knows.
    """
    table = _known(References, table)
    if isinstance(table, dict) and isinstance(table.get("policies"), dict):
        table["policies"] = {name: _known(Policy, each) for name, each in table["policies"].items()}
    try:
        return build(References, table, Where(where))
    except DefinitionError as error:
        raise RecordError(str(error)) from error


def _known(cls: type[Policy] | type[References], table: Any) -> Any:
    if not isinstance(table, dict):
        return table
    names = {field.name for field in fields(cls)}
    return {key: table[key] for key in table if key in names}


def keep_references(root: Path, key: str, table: Mapping[str, Any]) -> Path:
    """Write them down for the next time. Raises RecordError (73, 74), also for a linked folder."""
    folder = root / REFERENCES
    if folder.is_symlink():  # in a results folder from somebody else it could lead anywhere
        raise RecordError(one_line(f"{folder}: is a symbolic link"), CANNOT_CREATE)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if folder.is_symlink():
            raise OSError(ELOOP, "it is a symbolic link")
    except OSError as error:
        message = one_line(f"{folder}: cannot be created: {error.strerror}")
        raise RecordError(message, CANNOT_CREATE) from error
    write_json_atomic(folder / f"{key}.json", table)
    return folder / f"{key}.json"
