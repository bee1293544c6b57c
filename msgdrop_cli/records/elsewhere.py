"""Runs that a published study stands on and that lie in another one beside it: named, not copied.

`elsewhere.json` in a study's folder has one entry for each of them, by the names of its question.
"""

import os
from collections.abc import Container, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path, PurePath, PurePosixPath

from msgdrop_cli.definition.spec import NAME
from msgdrop_cli.definition.strict import Where, convert
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.counted import PUBLISHED
from msgdrop_cli.records.files import read_json, remove_file, write_json_atomic
from msgdrop_cli.records.folders import RUN, run_folders
from msgdrop_cli.records.listings import listed
from msgdrop_cli.records.store import Listing, RunRecord, list_runs, look_through

ELSEWHERE = "elsewhere.json"
"""The file in a published folder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Entry:
    """A run, and what the study calls it."""

    folder: str
    """`study/pursuit-n6/dcc-s1-01234567`, from where the studies lie."""
    run_id: str
    variant: str
    label: str
    overrides: tuple[str, ...]
    definition: str
    profile: str

    def __post_init__(self) -> None:
        if not _can_be_named(PurePosixPath(self.folder)):
            raise ValueError("folder: expected study/game/run")
        for key in ("variant", "definition", "profile"):
            if not NAME.fullmatch(getattr(self, key)):
                raise ValueError(f"{key} is not a name")


def keep_elsewhere(study: Path, records: Sequence[RunRecord]) -> list[Path]:
    """Write which runs of other studies beside it a study stands on; of none there is no file.

    Returns what is written. Raises RecordError (74) if that cannot be.
    """
    if not records:
        remove_file(study / ELSEWHERE)
        return []
    entries = [
        _Entry(
            folder=record.path.resolve().relative_to(study.resolve().parent).as_posix(),
            run_id=record.run_id,
            variant=record.variant,
            label=record.label,
            overrides=record.overrides,
            definition=record.definition,
            profile=record.profile,
        )
        for record in sorted(records, key=lambda each: each.path)
    ]
    write_json_atomic(study / ELSEWHERE, [asdict(entry) for entry in entries])
    return [study / ELSEWHERE]


def runs_of(root: Path) -> Listing:
    """What `look_through` finds, and then what each study there names, once more by its names.

    A study whose list is damaged is passed over where others are asked for, too. Raises RecordError
    as `look_through` does, but not for a study that has no run of its own.
    """
    elsewhere, passed_over = list[RunRecord](), list[str]()
    for study in studies_in(root):
        try:
            elsewhere += read_elsewhere(study)
        except RecordError as error:
            if study == root:
                raise
            passed_over.append(f"what {study.name} names: {error}")
    try:
        here = look_through(root)
    except RecordError:
        if not elsewhere or run_folders(root).runs:
            raise
        here = Listing([], "")
    told = filter(None, (here.passed_over, *passed_over))
    return Listing([*here.records, *elsewhere], "; ".join(told))


def studies_in(root: Path) -> list[Path]:
    """The folders that name runs: one study, or those that a results folder holds; by no link.

    Raises RecordError if `root`, or what is published in it, cannot be read.
    """
    published = root / PUBLISHED
    inside = [*listed(root), *([] if published.is_symlink() else listed(published))]
    studies = [root, *(folder for folder in inside if not folder.is_symlink())]
    return [folder for folder in studies if os.path.lexists(folder / ELSEWHERE)]


def read_elsewhere(study: Path) -> list[RunRecord]:
    """The runs of other studies that a study stands on, by its names.

    Raises RecordError (2) for a list that is damaged, and for runs that are not where it says.
    """
    path = study / ELSEWHERE
    if not os.path.lexists(path):
        return []
    try:
        entries: Iterable[_Entry] = convert(read_json(path), tuple[_Entry, ...], Where(str(path)))
    except DefinitionError as error:
        raise RecordError(str(error)) from error
    return [_record(study.resolve().parent, entry, path) for entry in entries]


def runs_beside(study: Path, run_ids: Container[str]) -> dict[str, list[RunRecord]]:
    """By run id, the published copies in the other studies that lie beside one, and behind no link.

    Raises RecordError for a damaged one of these runs.
    """
    found: dict[str, list[RunRecord]] = {}
    studies = study.resolve().parent
    for file in sorted(studies.glob(f"*/*/*/{RUN}")):
        folder = file.parent
        inside = folder.relative_to(studies)
        asked = folder.name.rpartition("-")[2] in run_ids and inside.parts[0] != study.name
        if asked and _can_be_named(inside) and folder.resolve() == folder:
            for record in list_runs(folder):
                if not record.is_own:
                    found.setdefault(record.run_id, []).append(record)
    return found


def _can_be_named(inside: PurePath) -> bool:
    return len(inside.parts) == 3 and all(map(NAME.fullmatch, inside.parts))


def _record(studies: Path, entry: _Entry, path: Path) -> RunRecord:
    folder = studies / entry.folder
    lies = folder.resolve() == folder and (folder / RUN).is_file()  # behind no link
    found = list_runs(folder) if lies else []
    if [record.run_id for record in found] != [entry.run_id]:
        raise RecordError(
            f"{path}: run {entry.run_id} is not in {folder}; put it back, or remove this file and"
            " publish the study once more"
        )
    names = asdict(entry) | {"overrides": list(entry.overrides)}
    del names["folder"]
    return RunRecord(folder, found[0].run | names, found[0].derived)
