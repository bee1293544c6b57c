"""Recorded link traces as files: which one is meant, and who heard whom in it.

step,receiver,sender,age
0,0,1,0            in the first step agent 0 hears what agent 1 says in it
0,1,0,2            and agent 1 what agent 0 said two steps before
0,2,0,             an empty age: nothing arrives, as where there is no row
"""

import hashlib
import re
import stat
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from msgdrop_cli.definition.strict import one_line, shown

LOST = 255
"""The age of what does not arrive."""
OLDEST = 100
"""The greatest age of what does."""
_HEADERS = ("step,receiver,sender,age", "step,receiver,sender")
_LARGEST_FILE = 16 * 2**20
_MOST = {"step": 999_999, "receiver": 254, "sender": 254, "age": OLDEST}
_MOST_ENTRIES = 2**26
"""Steps times directed links: they are kept a byte each."""
_RECORDED = re.compile(r"([A-Za-z0-9._-]{1,64})@([0-9a-f]{8})")


class Trace(NamedTuple):
    """Who heard whom, step by step."""

    agents: int
    steps: int
    ages: bytearray
    """steps * agents * (agents - 1) of them: sender k of agent i is agent k, or k + 1 from i on."""


@dataclass(frozen=True, slots=True, order=True)
class TraceFile:
    """A file by its name and its content, which is what tells two of them apart."""

    name: str
    digest: str = ""
    """The first 8 hex digits of the content's SHA-256; empty until somebody has looked."""
    path: Path | None = field(default=None, compare=False)
    """Where it lies; None if only a record speaks of it."""

    @classmethod
    def read(cls, text: str) -> "TraceFile":
        """What people write, a path, and what records do, `name@digest`; opens nothing."""
        if recorded := _RECORDED.fullmatch(text):
            return cls(recorded[1], recorded[2])
        if not text or "\0" in text:
            raise ValueError("a trace is a file: trace:links.csv")
        return cls(re.sub(r"[^A-Za-z0-9._-]", "-", Path(text).name)[-64:] or "-", "", Path(text))

    def __str__(self) -> str:
        return f"{self.name}@{self.digest}" if self.digest else self.name

    def located(self, folder: Path) -> "TraceFile":
        """With its digest; a path that is not absolute begins in `folder`.

        Raises ValueError if it cannot be read, or is known by its record only.
        """
        path = self._path() if self.path is None else folder / self.path
        return replace(self, path=path, digest=_digest(_content(path)))

    def trace(self) -> Trace:
        """What stands in it. Raises ValueError, naming file and line, for what is no trace."""
        path = self._path()
        content = _content(path)
        if self.digest and _digest(content) != self.digest:
            raise ValueError(_problem(path, "is another file than when it was asked for"))
        return _parsed(content, path)

    def _path(self) -> Path:
        if self.path is None:
            raise ValueError(f"a record names it by its content; name the file: trace:{self.name}")
        return self.path


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:8]


def _content(path: Path) -> bytes:
    """No more than a trace may have."""
    try:
        facts = path.stat()
        if not stat.S_ISREG(facts.st_mode):
            raise ValueError(_problem(path, "is no file"))
        if facts.st_size > _LARGEST_FILE:
            raise ValueError(_problem(path, f"has more than {_LARGEST_FILE:,} bytes"))
        with path.open("rb") as file:
            return file.read(_LARGEST_FILE)
    except OSError as error:
        raise ValueError(_problem(path, f"cannot be read: {error.strerror}")) from error


def _parsed(content: bytes, path: Path) -> Trace:
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise ValueError(_problem(path, "is not in UTF-8")) from error
    numbered = [(n, line) for n, line in enumerate(lines, 1) if not line.startswith("#")]
    if not numbered or numbered[0][1] not in _HEADERS:
        line = numbered[0][0] if numbered else 1
        raise ValueError(_problem(path, f"line {line}: expected {' or '.join(_HEADERS)}"))
    columns = numbered[0][1].split(",")
    rows = [_row(line, columns, number, path) for number, line in numbered[1:]]
    if not rows:
        raise ValueError(_problem(path, "has no rows"))
    steps = 1 + max(row[0] for row in rows)
    agents = 1 + max(max(row[1], row[2]) for row in rows)
    senders = agents - 1
    if steps * agents * senders > _MOST_ENTRIES:
        most = f"more than {_MOST_ENTRIES:,} messages"
        raise ValueError(_problem(path, f"{steps:,} steps of {agents} agents are {most}"))
    ages = bytearray([LOST]) * (steps * agents * senders)
    said = bytearray(len(ages))
    for (number, _), (step, receiver, sender, age) in zip(numbered[1:], rows, strict=True):
        place = (step * agents + receiver) * senders + sender - (sender > receiver)
        if said[place]:
            twice = f"step {step}, receiver {receiver}, sender {sender} stands there twice"
            raise ValueError(_problem(path, f"line {number}: {twice}"))
        said[place], ages[place] = 1, age
    return Trace(agents, steps, ages)


def _row(line: str, columns: list[str], number: int, path: Path) -> tuple[int, int, int, int]:
    """Step, receiver, sender and age of a line."""
    entries = line.split(",")
    if len(entries) != len(columns):
        expected = f"expected {','.join(columns)}, not {shown(line)}"
        raise ValueError(_problem(path, f"line {number}: {expected}"))
    values = []
    for name, entry in zip(columns, entries, strict=True):
        if name == "age" and not entry:
            values.append(LOST)
        elif entry.isascii() and entry.isdecimal() and len(entry) < 8 and int(entry) <= _MOST[name]:
            values.append(int(entry))
        else:
            expected = f"{name}: expected 0 to {_MOST[name]:,}, not {shown(entry)}"
            raise ValueError(_problem(path, f"line {number}: {expected}"))
    step, receiver, sender, *age = values
    if receiver == sender:
        raise ValueError(_problem(path, f"line {number}: agent {sender} is receiver and sender"))
    return step, receiver, sender, *(age or [0])  # type: ignore[return-value]


def _problem(path: Path, problem: str) -> str:
    return one_line(f"{path}: {problem}")
