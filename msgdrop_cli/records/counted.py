"""Which copy of a run counts: own ones and those that are published lie in one results folder."""

from collections.abc import Container, Iterable
from pathlib import Path

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.folders import run_folders
from msgdrop_cli.records.packed import log_bytes
from msgdrop_cli.records.store import (
    ENDED,
    EPISODES,
    POLICY,
    RUNS,
    RunRecord,
    list_runs,
    standing,
)

PUBLISHED = "published"
"""The folder of what is published in a results folder; only `publish` writes there."""


def preferred(copies: Iterable[RunRecord], question: str = "") -> list[RunRecord]:
    """The copies of one run; the first is the one that counts.

    An own one that has ended comes first: what diverged here is not made good by somebody else's.
    Then finished ones that are published: those of the question that asks, else the one with most
    episodes in its log, or with a policy. Then an own one that is on its way.
    """
    found = list(copies)
    if len(found) < 2:  # nothing is looked up
        return found
    return sorted(found, key=lambda copy: _rank(copy, question), reverse=True)


def by_run_id(records: Iterable[RunRecord]) -> dict[str, list[RunRecord]]:
    """The copies of every run, in the order of the records."""
    copies: dict[str, list[RunRecord]] = {}
    for record in records:
        copies.setdefault(record.run_id, []).append(record)
    return copies


def copies_of(root: Path, run_ids: Container[str]) -> dict[str, list[RunRecord]]:
    """By run id, the copies in a results folder: own runs, then published ones.

    Raises RecordError for a damaged own record, and for a damaged published one only if no other
    copy of its run has ended.
    """
    found = {run_id: _read(paths) for run_id, paths in _folders(root / RUNS, run_ids).items()}
    for run_id, paths in _folders(root / PUBLISHED, run_ids).items():
        own = found.setdefault(run_id, [])
        if not any(record.status in ENDED for record in own):
            own += _sound(paths)
    return {
        run_id: [record for record in records if record.run_id == run_id]
        for run_id, records in found.items()
    }


def _rank(record: RunRecord, question: str) -> tuple[int, ...]:
    if record.is_own:
        return 3 if record.status in ENDED else 1, *standing(record)
    if record.status != "done":
        return (0,)
    has_policy = (record.path / POLICY).is_file()
    try:
        episodes = int(record.derive("rows of episodes", lambda: _rows(record.path / EPISODES)))
    except RecordError:  # which may pass, so it is not kept
        episodes = -1
    return 2, record.definition == question, episodes, has_policy


def _rows(log: Path) -> int:
    """How many a log has, packed or not; RecordError if it is damaged."""
    return (log_bytes(log) or b"").count(b"\n")


def _folders(root: Path, run_ids: Container[str]) -> dict[str, list[Path]]:
    """By run id, the run folders that are named for one of them; nothing for no folder."""
    found: dict[str, list[Path]] = {}
    try:
        if not root.is_dir():
            return found
    except OSError:  # a name that is too long, a folder that is closed to us: no run either
        return found
    for path in run_folders(root).runs:
        run_id = path.name.rpartition("-")[2]
        if run_id in run_ids:
            found.setdefault(run_id, []).append(path)
    return found


def _read(paths: Iterable[Path]) -> list[RunRecord]:
    return [record for path in paths for record in list_runs(path)]


def _sound(paths: Iterable[Path]) -> list[RunRecord]:
    """Those that can be read; RecordError if none can."""
    records, damage = list[RunRecord](), None
    for path in paths:
        try:
            records += list_runs(path)
        except RecordError as error:
            damage = damage or error
    if damage and not records:
        raise damage
    return records
