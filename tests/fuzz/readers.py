"""Every reader of other people's files, by name: what it is given, and what sound files look like.

A reader may take what it is given, or raise an error of ours in one line; anything else, whatever
takes seconds or hundreds of megabytes included, is a finding.
"""

import contextlib
import gzip
import io
import json
import tempfile
import zipfile
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import torch
from safetensors.torch import save

from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.run_id import spec_from_dict
from msgdrop_cli.definition.traces import TraceFile
from msgdrop_cli.engine.checkpoint import MANIFEST, STATE, Checkpoints
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.engine.tensors import parse_tensors
from msgdrop_cli.errors import DefinitionError, MsgdropError
from msgdrop_cli.records.archive import FILES, SCHEMA, unpack
from msgdrop_cli.records.archive import MANIFEST as LISTED
from msgdrop_cli.records.ours import REPLAY, SEGMENT
from msgdrop_cli.records.packed import packed_name, read_log
from msgdrop_cli.records.references import read_references
from msgdrop_cli.records.seals import fingerprint, seal
from msgdrop_cli.records.store import EPISODES, METRICS, RUN, list_runs
from msgdrop_cli.records.sums import SUMS, sums_of
from tests.fake_runs import write_run
from tests.faults.study import QUESTION

LONGEST_LINE = 2_000
"""Characters of an error: what a terminal shows in a few lines."""


class Reader(NamedTuple):
    """One reader."""

    read: Callable[[bytes, Path], object]
    """Given a file's content, and an empty folder."""
    seeds: Callable[[], Iterable[bytes]]
    """Sound files."""


def try_reading(name: str, content: bytes) -> None:
    """Give content to a reader; raises AssertionError, or what the reader must not raise."""
    with tempfile.TemporaryDirectory(dir=_scratch()) as folder:
        said = ""
        try:
            READERS[name].read(content, Path(folder))
        except MsgdropError as error:
            said = str(error)
        assert not said or said.isprintable(), "the error is no line"
        assert len(said) < LONGEST_LINE, "the error is longer than anybody reads"


@cache
def _scratch() -> str | None:
    """A folder in memory, where there is one: a file is made for every try."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


def _record(content: bytes, folder: Path) -> None:
    """`run.json`, and all that is looked up in it."""
    run = folder / "run"
    run.mkdir()
    (run / RUN).write_bytes(content)
    for record in list_runs(folder):
        parts = (record.label, record.overrides, record.registration, record.reason, record.setup)
        assert "\x1b" not in repr(parts)
        with contextlib.suppress(MsgdropError):
            assert record.pretraining is None or record.pretraining.folder
        spec_from_dict(record.spec, catalogue(), "run.json: spec")


def _log(content: bytes, folder: Path) -> None:
    (folder / METRICS).write_bytes(content)
    json.dumps(read_log(folder / METRICS), allow_nan=False)


def _packed_log(content: bytes, folder: Path) -> None:
    (folder / packed_name(METRICS)).write_bytes(content)
    json.dumps(read_log(folder / METRICS), allow_nan=False)


def _run(content: bytes, folder: Path) -> None:
    """Both logs of a run; the first NUL stands between them."""
    record = write_run(folder, "dcc", 1, catches={0.0: 3})
    metrics, _, episodes = content.partition(b"\0")
    (record.path / METRICS).write_bytes(metrics)
    (record.path / EPISODES).write_bytes(episodes)
    record.metrics()
    record.episodes()


def _definition(content: bytes, folder: Path) -> None:
    file = folder / "question.toml"
    file.write_bytes(content)
    for run in plan(load_definition(str(file)), "quick", catalogue()).runs:
        for part in (run.variant, run.spec.environment, run.profile, run.definition):
            assert Path(part).name == part
            assert part not in (".", "..")


def _trace(content: bytes, folder: Path) -> None:
    file = folder / "links.csv"
    file.write_bytes(content)
    try:
        TraceFile.read(str(file)).located(folder).trace()
    except ValueError as error:  # whoever asks makes a line of ours of it
        raise DefinitionError(str(error)) from error


def _archive(content: bytes, folder: Path) -> None:
    """Nothing is written outside the folder."""
    path, there = folder / "a.zip", folder / "there"
    path.write_bytes(content)
    there.mkdir()
    try:
        unpack(path, there)
    finally:
        assert {each.name for each in folder.iterdir()} == {"a.zip", "there"}


def _sealed_archive(content: bytes, folder: Path) -> None:
    """As somebody makes it who can seal a manifest: the content is that of the manifest."""
    _archive(_sealed(_table(content)), folder)


def _sealed(table: dict[str, Any]) -> bytes:
    """The archive that a manifest speaks of, sealed."""
    table["seal"] = seal({key: each for key, each in table.items() if key != "seal"})
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(LISTED, json.dumps(table))
        for name in _names(table):
            archive.writestr(name, _content(name))
    return made.getvalue()


def _names(table: Any) -> list[str]:
    """The files that a manifest lists, as far as it lists any."""
    runs = table.get("runs") if isinstance(table, dict) else None
    places = runs.items() if isinstance(runs, dict) else ()
    return [
        f"{place}/{name}" for place, files in places if isinstance(files, dict) for name in files
    ]


def _checkpoint(content: bytes, folder: Path) -> None:
    """The manifest of a checkpoint, sealed."""
    table = _table(content)
    table["seal"] = seal({key: each for key, each in table.items() if key != "seal"})
    place = folder / "checkpoints" / f"{80:015}"
    place.mkdir(parents=True)
    (place.parent / REPLAY).mkdir()
    (place / MANIFEST).write_text(json.dumps(table))
    (place / STATE).write_bytes(_SOUND)
    for segment in filter(SEGMENT.fullmatch, table.get("files") or ()):
        (place.parent / REPLAY / segment).write_bytes(_SOUND)
    with contextlib.redirect_stderr(io.StringIO()):
        Checkpoints(folder, "0123abcd").latest(100)


def _table(content: bytes) -> dict[str, Any]:
    """The content as JSON, whatever it says; an empty table if it is none."""
    try:
        table = json.loads(content)
    except (ValueError, RecursionError):
        return {}
    return table if isinstance(table, dict) else {}


def _sums(content: bytes, folder: Path) -> None:
    (folder / SUMS).write_bytes(content)
    sums_of(folder)


def _references(content: bytes, folder: Path) -> None:
    read_references(_table(content), "references")


_SOUND = b"\x08\x00\x00\x00\x00\x00\x00\x00{}      "
"""The smallest file of tensors."""


def _content(name: str) -> bytes:
    """What stands in a file of an archive."""
    return _records()[0] if name.endswith(RUN) else _SOUND


@cache
def _records() -> list[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        path = write_run(Path(folder), "dcc", 1, catches={0.0: 3, 0.5: 2}).path
        return [(path / name).read_bytes() for name in (RUN, METRICS, EPISODES)]


def _archives() -> list[bytes]:
    files = {name: fingerprint(_content(name)) for name in FILES}
    table = {"schema": SCHEMA, "runs": {"pursuit-n6/dcc-s1-0123abcd": files}}
    return [json.dumps(table).encode()]


def _zips() -> list[bytes]:
    return [_sealed(json.loads(each)) for each in _archives()]


def _manifests() -> list[bytes]:
    counters = {
        "env_steps": 80, "added": 20, "streams": {"replay": 7}, "progress": [1, 2], "rows": 2,
        "logged_at": 80, "kernel": "c",
    }  # fmt: skip
    files = {STATE: fingerprint(_SOUND), f"{0:015}-{20:015}.safetensors": fingerprint(_SOUND)}
    table = {
        "run_id": "0123abcd",
        "counters": counters,
        "files": files,
        "schema": 1,
        "version": "1",
    }
    return [json.dumps(table).encode()]


def _played() -> list[bytes]:
    policies = {"random": {"meaning": "any action", "metrics": {"catches": 1.5}}}
    return [json.dumps({"episodes": 2, "seed": 1, "commit": None, "policies": policies}).encode()]


READERS = {
    "record": Reader(_record, lambda: _records()[:1]),
    "log": Reader(_log, lambda: _records()[1:]),
    "packed-log": Reader(_packed_log, lambda: [gzip.compress(each) for each in _records()[1:]]),
    "run": Reader(_run, lambda: [b"\0".join(_records()[1:])]),
    "definition": Reader(_definition, lambda: [QUESTION.encode()]),
    "trace": Reader(_trace, lambda: [b"step,receiver,sender,age\n0,0,1,0\n0,1,0,2\n1,2,0,\n"]),
    "archive": Reader(_archive, _zips),
    "sealed-archive": Reader(_sealed_archive, _archives),
    "checkpoint": Reader(_checkpoint, _manifests),
    "tensors": Reader(
        lambda content, folder: parse_tensors(content, folder / "policy.safetensors"),
        lambda: [save({"a": torch.ones(2, 3), "b": torch.zeros(1, dtype=torch.int64)})],
    ),
    "sums": Reader(_sums, lambda: [f"{'0' * 64}  runs/a/run.json\n".encode()]),
    "references": Reader(_references, _played),
}
