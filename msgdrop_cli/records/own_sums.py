"""`run.sha256`: the files of one finished run with their digests, as `sha256sum -c` reads them.

The list begins when a run is done and goes along with every later write, such as that of another
evaluation; while a file is being replaced it names both digests, so that no crash leaves a run that
its list denies. Runs that an earlier version finished have none; published runs have SHA256SUMS.
"""

import hashlib
from collections.abc import Iterator, Mapping
from os.path import lexists
from pathlib import Path
from typing import Any

from msgdrop_cli.records.files import (
    json_bytes,
    read_bytes,
    remove_file,
    write_bytes_atomic,
    write_json_atomic,
)
from msgdrop_cli.records.folders import EPISODES, METRICS, POLICY, RUN
from msgdrop_cli.records.sums import Difference, digest, list_text, parse_list, read_list

RUN_SUMS = "run.sha256"
"""The file in the folder of a run that is done."""
_FILES = (EPISODES, METRICS, POLICY, RUN)
"""What it lists, where that is there."""


def write_listed(file: Path, content: bytes, *, begin: bool = False) -> None:
    """Replace a run's file whole or not at all, and its digest in the run's list.

    Without a list only the file is written, or with `begin` a list of what lies there is begun.
    Raises RecordError: damaged (2) or not writable (74), the old file intact.
    """
    sums = file.parent / RUN_SUMS
    if lexists(sums):
        known = set(read_list(sums))
    elif begin:
        known = set(_present(file.parent))
    else:
        write_bytes_atomic(file, content)
        return
    new = (file.name, hashlib.sha256(content).hexdigest())
    write_bytes_atomic(sums, list_text({*known, new}))
    write_bytes_atomic(file, content)
    write_bytes_atomic(sums, list_text({new, *(each for each in known if each[0] != file.name)}))


def write_record(folder: Path, run: Mapping[str, Any]) -> None:
    """Replace `run.json`: the list of a run begins when that says it is done, and no other has one.

    Raises RecordError: damaged (2) or not writable (74), the old file intact.
    """
    if run["status"] == "done":
        write_listed(folder / RUN, json_bytes(run), begin=True)
    else:
        remove_file(folder / RUN_SUMS)
        write_json_atomic(folder / RUN, run)


def begin_list(folder: Path) -> None:
    """List the files of a finished run that was carried here; RecordError (2, 74)."""
    write_bytes_atomic(folder / RUN_SUMS, list_text(_present(folder)))


def run_differences(folder: Path) -> list[Difference]:
    """How a run differs from its list; RecordError if that cannot be read (2).

    Who replaces a file meanwhile changes the list before it, so then all is read once more.
    """
    sums = folder / RUN_SUMS
    content = read_bytes(sums)
    while found := [*_differences(folder, content)]:
        before, content = content, read_bytes(sums)
        if content == before:
            break
    return found


def _differences(folder: Path, content: bytes) -> Iterator[Difference]:
    """How the files, read now, differ from this list."""
    sums = folder / RUN_SUMS
    said, found = parse_list(content, sums), dict(_present(folder))
    for name in sorted({*dict(said), *found}):
        expected = [digest for each, digest in said if each == name]
        if name not in found:
            yield Difference(folder / name, "file", "one", "none")
        elif not expected:
            yield Difference(folder / name, "file", f"none that {RUN_SUMS} does not list", "one")
        elif found[name] not in expected:
            yield Difference(folder / name, "SHA-256", expected[-1], found[name] or "no file")
    if content != list_text(set(said)):
        yield Difference(sums, "form", "each file once, sorted, in whole lines", "another")


def _present(folder: Path) -> Iterator[tuple[str, str]]:
    return ((name, digest(folder / name)) for name in _FILES if lexists(folder / name))
