"""What others may send: hostile files by kind, names, arguments, and what the fuzzer makes of them.

What was found once stays in `tests/corpus`, one file or line each, and is tried by the test suite.
"""

import gzip
import io
import json
import os
import pickle
import struct
import zipfile
from collections.abc import Callable
from functools import partial
from itertools import chain
from pathlib import Path
from random import Random

from hypothesis import strategies as st

from tests.faults.study import QUESTION

CORPUS = Path(__file__).parents[1] / "corpus"
NAMES = tuple(json.loads((CORPUS / "names.json").read_text()))
"""Hostile names: of folders, variants, games, settings."""
ARGUMENTS = (
    ("train", "--env", "{}", "--dry-run"),
    ("train", "--algorithm", "{}", "--dry-run"),
    ("train", "--profile", "{}", "--dry-run"),
    ("train", "--set", "{}=1", "--dry-run"),
    ("train", "--set", "algorithm.gamma={}", "--dry-run"),
    ("ablate", "{}", "--dry-run"),
    ("publish", "{}"),
)
"""Command lines that a name stands in."""
_LARGE = 30_000_000


class _Execute:
    """A pickle that makes a file when it is loaded."""

    def __init__(self, canary: Path) -> None:
        self.canary = canary

    def __reduce__(self) -> tuple[Callable[..., object], tuple[str]]:
        return os.mkdir, (str(self.canary),)


def _pickled(canary: Path) -> bytes:
    return pickle.dumps(_Execute(canary))


def _torch_file(canary: Path) -> bytes:
    """A zip as `torch.save` makes it, around the pickle."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("archive/data.pkl", _pickled(canary))
        archive.writestr("archive/version", "3\n")
    return file.getvalue()


def _numpy_file(canary: Path) -> bytes:
    head = b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }".ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + _pickled(canary)


def _tensors(header: object, body: bytes = b"", length: int | None = None) -> bytes:
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text) if length is None else length) + text + body


def _tensor(first: int, last: int, shape: list[int], dtype: str = "F32") -> dict[str, object]:
    return {"dtype": dtype, "shape": shape, "data_offsets": [first, last]}


_CONTENTS: dict[str, Callable[[Path], bytes]] = {
    "a pickle": _pickled,
    "a torch file": _torch_file,
    "a numpy file": _numpy_file,
    "nothing": lambda _: b"",
    "zeros": lambda _: bytes(1000),
    "a packed bomb": lambda _: gzip.compress(bytes(_LARGE)),
    "deep lists": lambda _: b"[" * 200_000,
    "deep tables": lambda _: b'{"a":' * 200_000,
    "a long text": lambda _: b'"' + b"x" * _LARGE + b'"',
    "a huge number": lambda _: b"9" * 100_000,
    "not finite": lambda _: b'{"env_steps": NaN, "episode": Infinity, "x": 1e999}\n',
    "escape sequences": lambda _: b'{"reason": "\\u001b]0;x\\u0007\x1b[2J", "run_id": "\\u202e"}\n',
    "UTF-16": lambda _: '{"run_id": "a"}'.encode("utf-16"),
    "half a letter": lambda _: b'{"run_id": "\xc3"}',
    "a text with a NUL": lambda _: b'{"run_id": "a\\u0000b", "env_steps": 1}\n',
    "a shell": lambda c: b'{"run_id": "$(mkdir %s)", "label": "`mkdir %s`"}\n' % ((bytes(c),) * 2),
    "a page": lambda _: b'{"label": "<script>alert(1)</script>", "env_steps": 1}\n',
}
_POLICIES: dict[str, bytes] = {
    "a header of 2^63": _tensors({}, length=2**63),
    "a header of a gigabyte": _tensors({}, length=2**30),
    "overlapping tensors": _tensors({"a": _tensor(0, 8, [2]), "b": _tensor(4, 12, [2])}, bytes(12)),
    "an offset before the file": _tensors({"a": _tensor(-8, 0, [2])}, bytes(8)),
    "an offset beyond the file": _tensors({"a": _tensor(0, 2**40, [2**38])}, bytes(8)),
    "a shape that overflows": _tensors({"a": _tensor(0, 0, [2**62, 2**62])}),
    "a negative shape": _tensors({"a": _tensor(0, 8, [-2])}, bytes(8)),
    "an unknown type": _tensors({"a": _tensor(0, 8, [2], "../x")}, bytes(8)),
    "10,000 tensors": _tensors({str(n): _tensor(0, 0, [0]) for n in range(10_000)}),
    "a name that leads elsewhere": _tensors({"../../x": _tensor(0, 4, [1])}, bytes(4)),
    "an empty header": _tensors({}),
}
_FILES = ("policy.safetensors", "run.json", "episodes.jsonl")


def _sparse(file: Path) -> None:
    """Two gigabytes that take no room on the disk."""
    with file.open("wb") as hole:
        hole.truncate(2**31 - 1)


_LINKS: dict[str, Callable[[Path], None]] = {
    "a link to a password": lambda file: file.symlink_to("/etc/passwd"),
    "a link to itself": lambda file: file.symlink_to(file),
    "a pipe": lambda file: os.mkfifo(file),
    "a folder": lambda file: file.mkdir(),
    "two gigabytes of nothing": _sparse,
    "a link to zeros": lambda file: file.symlink_to("/dev/zero"),
}


def _put(name: str, content: Callable[[Path], bytes], results: Path, canary: Path) -> None:
    next(results.rglob(name)).write_bytes(content(canary))


def _ignoring(content: bytes, _: Path) -> bytes:
    return content


def _stand_in(name: str, make: Callable[[Path], None], results: Path, _: Path) -> None:
    file = next(results.rglob(name))
    file.unlink()
    make(file)


HOSTILE_FILES: dict[str, Callable[[Path, Path], None]] = {
    **{
        f"{what} for {name}": partial(_put, name, content)
        for name in _FILES
        for what, content in _CONTENTS.items()
    },
    **{
        f"{what} for a policy": partial(_put, _FILES[0], partial(_ignoring, content))
        for what, content in _POLICIES.items()
    },
    **{
        f"{what} for {name}": partial(_stand_in, name, make)
        for name in _FILES
        for what, make in _LINKS.items()
    },
}
"""By what it is and for which file of a results folder: puts it there; given a canary, too."""


def mutated(results: Path, rng: Random) -> str:
    """Change some bytes of a sound file of a run; returns what was changed."""
    file = next(results.rglob(rng.choice((*_FILES, "metrics.jsonl"))))
    content = bytearray(file.read_bytes())
    for _ in range(rng.choice((1, 3, 30))):
        place = rng.randrange(len(content))
        kind = rng.randrange(3)
        if kind == 0:
            content[place] = rng.randrange(256)
        elif kind == 1:
            del content[place : place + rng.choice((1, 10))]
        else:
            content[place:place] = rng.choice((b"9" * 30, b"{", b'"', b"-", b"\x00", b"\n"))
        content = content or bytearray(b"{")
    file.write_bytes(content)
    return f"bytes of {file.name} changed"


def definitions() -> st.SearchStrategy[tuple[str, list[str]]]:
    """A definition's text, and options: sound ones with mistakes, and anything at all."""
    lines = st.sampled_from(QUESTION.splitlines())
    values = st.one_of(
        st.text(max_size=20),
        st.integers().map(str),
        st.floats().map(str),
        st.sampled_from(["[]", "{}", '""', "true", "nan", "1e400", "'''", "[[[", *NAMES]),
    )
    keys = st.one_of(
        st.sampled_from(
            ["algorithm.rate", "training.games", "environment.time_limit", "algorithm.name",
             "training.train_env_steps", "variants.md-0.2.algorithm.rate", "algorithm.gama"]
        ),
        st.text(max_size=12),
    )  # fmt: skip
    changed = st.tuples(lines, st.one_of(lines, st.builds("{} = {}".format, keys, values))).map(
        lambda pair: QUESTION.replace(pair[0], pair[1], 1) if pair[0] else QUESTION + pair[1]
    )
    sets = st.builds("{}={}".format, keys, values).map(lambda text: ["--set", text])
    others = st.sampled_from(
        [["--seeds", "0"], ["--seed", "-1"], ["--workers", "x"], ["--profile", "\x1b"],
         ["--seeds", "1,1"], ["--reading", "x"], ["--nonsense"], ["--device", "tpu"]]
    )  # fmt: skip
    options = st.lists(st.one_of(sets, others), max_size=3).map(_joined)
    return st.tuples(st.one_of(changed, st.just(QUESTION), st.text(max_size=200)), options)


def _joined(parts: list[list[str]]) -> list[str]:
    return list(chain.from_iterable(parts))
