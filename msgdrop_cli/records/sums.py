"""`SHA256SUMS`: every file of a published folder with its digest, as `sha256sum -c` reads it.

What lies in the folder gives one such list, byte for byte; so any other list, any changed, missing
or added file, and any entry that is no file is found.
"""

import hashlib
import os
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import opened, read_bytes, write_bytes_atomic

SUMS = "SHA256SUMS"
"""The file in a published folder."""
_NAME = r"[^\\\r\n\ud800-\udfff]+"
"""Other names would have to be escaped, or are in no UTF-8; none of ours is like that."""
_LINE = re.compile(rf"([0-9a-f]{{64}})  ({_NAME})")
_DIGEST = re.compile(r"\b([0-9a-f]{12})[0-9a-f]{52}\b")


class Difference(NamedTuple):
    """One thing that is not as it should be."""

    file: Path
    what: str
    """What of the file, in a word or two."""
    expected: str
    found: str

    def __str__(self) -> str:
        """File, what, expected and found in one line; of digests the first digits."""
        expected, found = (_DIGEST.sub(r"\1…", each) for each in (self.expected, self.found))
        return one_line(f"{self.file}: {self.what}: expected {expected}, found {found}")


def list_sums(folder: Path) -> Path:
    """Write the list of what lies in a folder now, whole or not at all.

    Raises RecordError: what cannot be listed (2) or written (74).
    """
    check_listable(folder)
    write_bytes_atomic(folder / SUMS, list_text(_files(folder).items()))
    return folder / SUMS


def check_listable(folder: Path) -> None:
    """RecordError (2) if something lies in a folder that `list_sums` would refuse."""
    for name, path in _entries(folder):
        if path.is_symlink() or not path.is_file() or not re.fullmatch(_NAME, name):
            raise RecordError(one_line(f"{path}: is no file that can be listed; remove it"))


def sums_of(folder: Path) -> dict[str, str]:
    """Digests by name, as the folder's list says; RecordError (2) if there is none to be read."""
    return dict(read_list(folder / SUMS))


def read_list(file: Path) -> list[tuple[str, str]]:
    """Names and digests as a list says; RecordError (2) if it cannot be read."""
    return parse_list(read_bytes(file), file)


def parse_list(content: bytes, file: Path) -> list[tuple[str, str]]:
    """The same of the bytes of a list; file: where they were read."""
    lines = content.decode(errors="replace").removesuffix("\n").split("\n")
    sums = []
    for number, line in enumerate(lines, start=1):
        if not (read := _LINE.fullmatch(line)):
            raise RecordError(one_line(f"{file}: line {number}: is no digest and name"))
        sums.append((read[2], read[1]))
    return sums


def list_text(sums: Iterable[tuple[str, str]]) -> bytes:
    """Such a list, sorted by name; sums: name and digest."""
    return "".join(f"{digest}  {name}\n" for name, digest in sorted(sums)).encode()


def digest(path: Path) -> str:
    """SHA-256 of a file, empty for what is none; RecordError (2) if it cannot be read."""
    if path.is_symlink() or not path.is_file():
        return ""
    with opened(path, sys.maxsize) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def differences(folder: Path) -> Iterator[Difference]:
    """How a folder differs from its list: changed and missing files, what is not listed, the list.

    Raises RecordError: the list or a file cannot be read (2).
    """
    if not os.path.lexists(folder / SUMS):
        yield Difference(folder / SUMS, "file", "the list that msgdrop publish writes", "none")
        return
    said, found = sums_of(folder), _files(folder)
    for name in sorted({*said, *found}):
        if name not in found:
            yield Difference(folder / name, "file", "one", "none")
        elif name not in said:
            yield Difference(folder / name, "file", f"none that {SUMS} does not list", "one")
        elif said[name] != found[name]:
            yield Difference(folder / name, "SHA-256", said[name], found[name] or "no file")
    if said == found and read_bytes(folder / SUMS) != list_text(found.items()):
        yield Difference(folder / SUMS, "form", "each file once, sorted, in whole lines", "another")


def _files(folder: Path) -> dict[str, str]:
    """The digest of everything in a folder but its list, by place; empty for what is no file."""
    return {name: digest(path) for name, path in _entries(folder)}


def _entries(folder: Path) -> Iterator[tuple[str, Path]]:
    """Everything in a folder but its list, with its place there."""
    for place, folders, names in os.walk(folder):
        here = Path(place)
        links = [name for name in folders if (here / name).is_symlink()]  # not walked into
        for path in (here / name for name in (*names, *links)):
            if path != folder / SUMS:
                yield path.relative_to(folder).as_posix(), path
