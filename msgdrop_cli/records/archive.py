"""Archives of finished runs, to be carried to another machine: a zip that says what it holds.

    MANIFEST.json                          schema, size and SHA-256 of every file, and a seal
    pursuit-n6/dcc-s1-a932b0b3/run.json    and the three other files of each run

The same runs make the same bytes. What is read is believed only as a whole: every name, size and
digest is checked before the first file is written, and nothing is ever extracted by its name.
"""

import io
import json
import re
import stat
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from msgdrop_cli.definition.spec import NAME
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import (
    CANNOT_CREATE,
    CANNOT_WRITE,
    LARGEST_FILE,
    read_bytes,
    sync_folder,
    write_bytes_atomic,
)
from msgdrop_cli.records.own_sums import begin_list
from msgdrop_cli.records.parsing import RECORD, TABLE, parse_json
from msgdrop_cli.records.seals import fingerprint, seal
from msgdrop_cli.records.store import EPISODES, METRICS, POLICY, RUN, RunRecord, list_runs
from msgdrop_cli.records.temporary import TEMPORARY
from msgdrop_cli.signals import scratch_folder

SCHEMA = 1
MANIFEST = "MANIFEST.json"
LARGEST_ARCHIVE = 15_000_000
"""Bytes of an archive; no larger one is read either."""
LARGEST_CONTENT = 100_000_000
"""Bytes of an archive's files together; numbers shrink to a twelfth at most, policies hardly."""
MOST_RUNS = 256
"""Of an archive; so many of the smallest fill one."""
FILES = (METRICS, EPISODES, POLICY, RUN)
"""What is carried of each run. `run.json` comes last: without it a folder is no run."""
_LARGEST = {RUN: RECORD.size, MANIFEST: TABLE.size}
"""Bytes of one file, where it is not LARGEST_FILE as for logs and policies."""
_PLACE = re.compile(rf"{NAME.pattern}/[A-Za-z0-9][A-Za-z0-9._-]{{0,99}}")
_OVERHEAD = 4_096
"""Bytes that names, digests and zip's own headers take at most, a run."""
_BAD_ZIP = (
    *(zipfile.BadZipFile, zlib.error, EOFError, ValueError, KeyError, IndexError, OSError),
    *(ArithmeticError, NotImplementedError, RuntimeError),
)
"""What zipfile raises for somebody else's bytes."""


def pack(records: Sequence[RunRecord], folder: Path, name: str) -> list[Path]:
    """Put the runs that no archive `<name>-<number>.zip` in `folder` holds into archives.

    The last archive is filled up before a new one is begun; a full one is never written again.
    Returns the archives written. Raises RecordError: not writable (74), or, with the others
    packed, a run that is too large for any archive (2).
    """
    archives = sorted(folder.glob(f"{name}-[0-9]*.zip"), key=_number)
    held = [contents(archive) for archive in archives]
    runs = {_place(record): record for record in records}
    new = [place for place in runs if not any(place in places for places in held)]
    if not new:
        return []
    number = max(map(_number, archives), default=0) + 1
    if held and set(held[-1]) <= set(runs):
        new, number = [*held[-1], *new], number - 1
    bins, too_large = _bins([runs[place] for place in new])
    written = []
    for part in bins:
        path = folder / f"{name}-{number:02d}.zip"
        write_archive(path, part)
        written.append(path)
        number += 1
    if too_large:
        raise RecordError(
            one_line(
                f"{too_large[0].path}: does not fit into an archive of {LARGEST_ARCHIVE:,} bytes;"
                " carry this folder in another way"
            )
        )
    return written


def _number(archive: Path) -> int:
    """What stands at the end of its name: others may have been taken away."""
    digits = archive.stem.rpartition("-")[2]
    return int(digits) if digits.isdecimal() else 0


def write_archive(path: Path, records: Iterable[RunRecord]) -> None:
    """Write one archive of these runs, whole or not at all; RecordError (2, 74)."""
    files = {_place(record): _files(record) for record in records}
    manifest: dict[str, Any] = {
        "schema": SCHEMA,
        "runs": {
            place: {name: fingerprint(content) for name, content in run.items()}
            for place, run in files.items()
        },
    }
    manifest["seal"] = seal(manifest)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        # A ZipInfo without more has no clock and no owner in it: the same runs, the same bytes.
        _add(archive, MANIFEST, json.dumps(manifest, indent=1).encode())
        for place, run in files.items():
            for name, content in run.items():
                _add(archive, f"{place}/{name}", content)
    write_bytes_atomic(path, buffer.getvalue())


def contents(path: Path) -> tuple[str, ...]:
    """The places `<environment>/<run>` of the runs in an archive; RecordError (2)."""
    with _opened(path) as archive:
        return tuple(_manifest(archive, path))


def unpack(path: Path, folder: Path) -> list[RunRecord]:
    """Check an archive from end to end, and write its runs below the empty `folder`.

    Raises RecordError (2): it is no archive of msgdrop, or damaged, or holds something else.
    """
    with _opened(path) as archive:
        files = {
            f"{place}/{name}": expected
            for place, run in _manifest(archive, path).items()
            for name, expected in run.items()
        }
        # Twice: all are checked before the first is written, and need not fit into the memory.
        for name, expected in files.items():
            _content(archive, name, expected, path)
        for name, expected in files.items():
            _write(folder / name, _content(archive, name, expected, path))
    try:
        return list_runs(folder)
    except RecordError as error:
        raise _bad(path, str(error).replace(f"{folder}/", "")) from error


def install(record: RunRecord, target: Path) -> None:
    """Copy an unpacked run to `target`, which does not exist, whole or not at all.

    Raises RecordError: the folder cannot be made (73) or written (74).
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        # A name that is not the run's, and run.json last: if we are killed here, this is no run.
        with scratch_folder(target.parent, TEMPORARY) as scratch:
            copy = scratch / "run"
            copy.mkdir()
            for name in FILES:
                write_bytes_atomic(copy / name, read_bytes(record.path / name))
            begin_list(copy)
            copy.rename(target)
            sync_folder(target.parent)
    except OSError as error:
        made = target.parent.is_dir() and not target.exists()
        code = CANNOT_WRITE if made else CANNOT_CREATE
        raise RecordError(
            one_line(f"{target}: cannot be written: {error.strerror}"), code
        ) from error


def _bins(records: Sequence[RunRecord]) -> tuple[list[list[RunRecord]], list[RunRecord]]:
    """The runs as they share archives, in their order, and those too large for any."""
    bins: list[list[RunRecord]] = []
    too_large: list[RunRecord] = []
    packed = plain = 0
    for record in records:
        files = _files(record)
        small = sum(len(zlib.compress(content)) for content in files.values()) + _OVERHEAD
        large = sum(map(len, files.values())) + _OVERHEAD
        if small > LARGEST_ARCHIVE or large > LARGEST_CONTENT:
            too_large.append(record)
            continue
        is_full = packed + small > LARGEST_ARCHIVE or plain + large > LARGEST_CONTENT
        if not bins or is_full or len(bins[-1]) == MOST_RUNS:
            bins.append([])
            packed = plain = 0
        bins[-1].append(record)
        packed, plain = packed + small, plain + large
    return bins, too_large


def _files(record: RunRecord) -> dict[str, bytes]:
    return {name: read_bytes(record.path / name) for name in FILES}


def _place(record: RunRecord) -> str:
    return f"{record.environment}/{record.path.name}"


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    archive.writestr(zipfile.ZipInfo(name), content, compress_type=zipfile.ZIP_DEFLATED)


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """The zip at `path`; everything that zipfile raises becomes a RecordError."""
    content = read_bytes(path, LARGEST_ARCHIVE)
    if content.count(b"PK\x01\x02") > 1 + len(FILES) * (MOST_RUNS + 1):  # one before each name
        raise _bad(path, "is no archive of msgdrop: it holds too many files")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            yield archive
    except _BAD_ZIP as error:
        raise _bad(path, f"is no archive of msgdrop, or damaged: {error}") from error


def _manifest(archive: zipfile.ZipFile, path: Path) -> dict[str, dict[str, Any]]:
    """Places of runs -> names of files -> fingerprints: just what the zip holds."""
    names = _safe_names(archive, path)
    if MANIFEST not in names:
        raise _bad(path, f"is no archive of msgdrop: it has no {MANIFEST}")
    manifest = parse_json(archive.read(MANIFEST), f"{path}: {MANIFEST}")
    if not isinstance(manifest, dict) or manifest.pop("seal", None) != seal(manifest):
        raise _bad(path, f"{MANIFEST} is damaged")
    if manifest.get("schema") != SCHEMA:
        problem = f"schema {str(manifest.get('schema'))[:20]} is unknown, expected {SCHEMA}"
        raise _bad(path, f"{problem}; a newer msgdrop may read it")
    runs = manifest.get("runs")
    if not isinstance(runs, dict) or not runs:
        raise _bad(path, "holds no runs")
    for place, files in runs.items():
        if not _PLACE.fullmatch(place):
            raise _bad(path, f"{place[:64]!r} is no place of a run")
        if not isinstance(files, dict) or set(files) != set(FILES):
            raise _bad(path, f"{place}: expected the files {', '.join(sorted(FILES))}")
    listed = {MANIFEST} | {f"{place}/{name}" for place, files in runs.items() for name in files}
    if odd := names ^ listed:
        raise _bad(path, f"{min(odd)[:99]!r} is in the zip or in its manifest only")
    return runs


def _safe_names(archive: zipfile.ZipFile, path: Path) -> set[str]:
    """The names of the zip's files, none of which has been read: no links, no bombs."""
    entries = archive.infolist()
    if sum(entry.file_size for entry in entries) > LARGEST_CONTENT:
        raise _bad(path, f"would unpack to more than {LARGEST_CONTENT:,} bytes")
    for entry in entries:
        largest = _LARGEST.get(entry.filename.rpartition("/")[2], LARGEST_FILE)
        if entry.file_size > largest:
            raise _bad(path, f"{entry.filename[:99]!r} would unpack to more than {largest:,} bytes")
        mode = entry.external_attr >> 16
        if entry.is_dir() or (stat.S_IFMT(mode) and not stat.S_ISREG(mode)):
            raise _bad(path, f"{entry.filename[:99]!r} is a folder, link or device, not a file")
        if entry.compress_type != zipfile.ZIP_DEFLATED or entry.flag_bits & 1:
            raise _bad(
                path, f"{entry.filename[:99]!r} is packed in a way that msgdrop does not use"
            )
    names = {entry.filename for entry in entries}
    if len(names) < len(entries):
        raise _bad(path, "holds two files of one name")
    return names


def _content(archive: zipfile.ZipFile, name: str, expected: object, path: Path) -> bytes:
    """One file as its fingerprint says; zipfile reads no byte more than the zip declares."""
    content = archive.read(name)
    if fingerprint(content) != expected:
        raise _bad(path, f"{name} is damaged: it is not what {MANIFEST} says")
    return content


def _write(file: Path, content: bytes) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = one_line(f"{file.parent}: cannot be created: {error.strerror}")
        raise RecordError(message, CANNOT_CREATE) from error
    write_bytes_atomic(file, content, durable=False)


def _bad(path: Path, problem: str) -> RecordError:
    return RecordError(one_line(f"{path}: {problem}"))
