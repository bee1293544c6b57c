"""Which folders are runs of ours; a results folder may hold other people's things, too.

A folder with a `run.json` is ours if it is called like a run (`<variant>-s<seed>-<id>`), or if that
file says `schema` and `run_id`, as Sacred's does not. Damage in ours is an error. What is not ours
is passed over, and so are links, which could lead anywhere, and folders that are closed to us.
"""

import os
import re
from collections.abc import Container, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from msgdrop_cli.definition.spec import NAME
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError, code_of
from msgdrop_cli.records.files import read_json
from msgdrop_cli.records.listings import scanned
from msgdrop_cli.records.parsing import RECORD
from msgdrop_cli.records.temporary import TEMPORARY

RUN = "run.json"
METRICS, EPISODES = "metrics.jsonl", "episodes.jsonl"
POLICY, PROGRESS = "policy.safetensors", "progress.json"
"""The files of a run folder, beside RUN."""
_RUN_NAME = re.compile(rf"{NAME.pattern}-s\d{{1,20}}-[0-9a-f]{{8}}")
_NO_FOLDER = (
    "there is no such folder; msgdrop ablate makes runs there, and published ones lie in"
    " results/published of the repository"
)
"""Who has installed a wheel has neither."""
DEEPEST = 32
"""Folders in each other below a results folder; ours are 3."""
_NAMED = 3
"""Things passed over that are named; the others are counted."""


class Found(NamedTuple):
    """What was found in or below a folder."""

    runs: tuple[Path, ...]
    """Run folders of ours, sorted."""
    passed_over: tuple[str, ...]
    """Everything else that looked like one or could hold one, in words, sorted."""

    def passed_over_in_words(self) -> str:
        """One line about all of it, empty if there is nothing."""
        if not self.passed_over:
            return ""
        more = len(self.passed_over) - _NAMED
        tail = f" and {more:,} more" if more > 0 else ""
        return one_line(f"passed over: {', '.join(self.passed_over[:_NAMED])}{tail}")


class _Inside(NamedTuple):
    """What stands in one folder."""

    has_record: bool
    folders: list[Path]
    """Those to go on with: no copy that is not yet whole."""
    links: list[Path]
    """But those to files, which are no runs: nobody needs to hear of them."""


def run_folders(root: Path) -> Found:
    """Look through a folder and all below it. Raises RecordError if `root` itself is unreadable."""
    runs: list[Path] = []
    passed_over: list[str] = []
    folders = [root]
    while folders:
        folder = folders.pop()
        place = folder.relative_to(root)
        try:
            inside = _inside(folder)
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            if folder == root:
                missing = isinstance(error, FileNotFoundError)
                problem = _NO_FOLDER if missing else f"cannot be read: {reason}"
                raise RecordError(one_line(f"{root}: {problem}"), code_of(error, 2)) from error
            if not isinstance(error, FileNotFoundError):  # it may go while we look
                passed_over.append(f"{place} ({reason})")
            continue
        if inside.has_record and _is_ours(folder):
            runs.append(folder)
            continue
        if inside.has_record:
            passed_over.append(f"{place / RUN} (not of msgdrop)")
        passed_over += [f"{link.relative_to(root)} (a link)" for link in inside.links]
        if len(place.parts) < DEEPEST:
            folders += inside.folders
    return Found(tuple(sorted(runs)), tuple(sorted(passed_over)))


def folders_with(root: Path, names: Container[str]) -> list[Path]:
    """The folders in or below `root` that hold something of one of these names, sorted.

    No link is followed, and what cannot be read has none.
    """
    found, folders = [], [(root, 0)]
    while folders:
        folder, depth = folders.pop()
        entries: Sequence[os.DirEntry[str]] = ()
        with suppress(OSError):
            entries = scanned(folder)
        if any(entry.name in names for entry in entries):
            found.append(folder)
        if depth < DEEPEST:
            inside = (Path(each.path) for each in entries if each.is_dir(follow_symlinks=False))
            folders += [(each, depth + 1) for each in inside]
    return sorted(found)


def _inside(folder: Path) -> _Inside:
    found = scanned(folder)
    return _Inside(
        any(entry.name == RUN for entry in found),
        [
            Path(entry.path)
            for entry in found
            if entry.is_dir(follow_symlinks=False) and not entry.name.startswith(TEMPORARY)
        ],
        [link for e in found if e.is_symlink() and not _is_file(link := Path(e.path))],
    )


def _is_file(link: Path) -> bool:
    try:
        return link.is_file()
    except OSError:  # a circle
        return False


def _is_ours(folder: Path) -> bool:
    if _RUN_NAME.fullmatch(folder.name):
        return True
    try:
        run = read_json(folder / RUN, RECORD)
    except RecordError:
        return False
    return isinstance(run, dict) and {"schema", "run_id"} <= set(run)
