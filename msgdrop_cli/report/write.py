"""Where reports are written, and how: whole files or none, nothing published, through no link."""

import os
from collections.abc import Mapping
from pathlib import Path, PurePath
from typing import NamedTuple

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.counted import PUBLISHED
from msgdrop_cli.records.files import (
    CANNOT_CREATE,
    CANNOT_WRITE,
    write_bytes_atomic,
)
from msgdrop_cli.records.store import RUNS
from msgdrop_cli.records.temporary import TEMPORARY, put_in_place
from msgdrop_cli.signals import scratch_folder

FIGURES = "figures"
"""The folder of the figures in a results folder, and in what is published."""
EXPORTS = "exports"
"""The folder of what other programs read, in a results folder."""
TABLES = "TABLES.md"
"""The page of tables that lies beside every published question's runs."""
_DEPTH = 3
"""A published run is `published/<question>-<profile>/<environment>/<run>`."""
_RUN_DEPTH = 2
"""A run is `runs/<environment>/<run>`."""


class Folder(NamedTuple):
    """A folder to write to: `root`, which people have named, and what is ours inside it.

    In there no link is followed: in a results folder from somebody else it could lead anywhere.
    """

    root: Path
    inside: PurePath = PurePath()

    def at(self, name: str) -> "Folder":
        """A folder in this one."""
        return Folder(self.root, self.inside / name)

    def made(self) -> Path:
        """Its path, made where it is missing; RecordError (73) for a link, or if it cannot be."""
        path = self.root
        try:
            path.mkdir(parents=True, exist_ok=True)
            for part in self.inside.parts:
                path = path / part
                if path.is_symlink():
                    problem = "is a symbolic link, and none is followed to write; remove it"
                    raise RecordError(one_line(f"{path}: {problem}"), CANNOT_CREATE)
                path.mkdir(exist_ok=True)
        except OSError as error:
            message = one_line(f"{path}: cannot be created: {error.strerror}")
            raise RecordError(message, CANNOT_CREATE) from error
        return path


def write_atomic(folder: Folder, name: str, content: bytes) -> Path:
    """Write a file and its folder; RecordError (73 the folder, 74) leaves nothing half-written."""
    path = folder.made() / name
    write_bytes_atomic(path, content)
    return path


def write_folder(folder: Folder, files: Mapping[str, bytes]) -> list[Path]:
    """Write a folder of files, whole or not at all; what was in it before is gone then.

    Raises RecordError (73 if it cannot be made, 74 if it cannot be written).
    """
    target = Folder(folder.root, folder.inside.parent).made() / folder.inside.name
    try:
        with scratch_folder(target.parent, TEMPORARY) as scratch:
            new = scratch / "new"
            new.mkdir()
            for name, content in files.items():
                write_bytes_atomic(new / name, content)
            put_in_place(new, target)
    except OSError as error:
        message = one_line(f"{target}: cannot be written: {error.strerror}")
        raise RecordError(message, CANNOT_WRITE) from error
    return [target / name for name in files]


def exports_folder(results: Path, name: str) -> Folder:
    """Where one format of the records in or below `results` goes: `exports/<name>` in there."""
    return _beside_records(results, EXPORTS, name)


def figures_folder(results: Path, *names: str) -> Folder:
    """Where figures of the records in or below `results` go: `figures/<names>` in there.

    Those of what is published, `results/published/x`, go to `results/figures/published/x`: what is
    committed is written by `publish` alone, and figures of own runs have their own place.
    """
    return _beside_records(results, FIGURES, *names)


def _beside_records(results: Path, kind: str, *names: str) -> Folder:
    if published := _published_above(results):
        inside = results.resolve().relative_to(published.parent)
        return Folder(home_of(results), PurePath(kind, inside, *names))
    return Folder(results, PurePath(kind, *names))


def home_of(results: Path) -> Path:
    """The results folder that `results` is or lies in; `results` itself if it is in none.

    What belongs to no run goes there: pages, reference policies, kept numbers, runs to come.
    """
    inside = _published_above(results) or _runs_above(results)
    if inside is None:
        return results
    return inside.parent if results.is_absolute() else Path(os.path.relpath(inside.parent))


def _published_above(results: Path) -> Path | None:
    """The folder of what is published that `results` is, or is a part of."""
    place = results.resolve()
    for folder in (place, *place.parents[:_DEPTH]):
        if folder.name == PUBLISHED and any(folder.glob(f"*/{TABLES}")):
            return folder
    return None


def _runs_above(results: Path) -> Path | None:
    """The folder of own runs that `results` is, or is a part of."""
    place = results.resolve()
    if (place / RUNS).is_dir():  # a results folder, whatever that lies in is called
        return None
    above = (folder for folder in (place, *place.parents[:_RUN_DEPTH]) if folder.name == RUNS)
    return next(above, None)
