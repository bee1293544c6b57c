"""A few packed bytes, or many plain ones, fill neither the memory nor the afternoon."""

import gzip
import json
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.commands.parts.options import check_episodes
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.spec import MOST_EPISODES, MOST_LOG_ROWS, Profile, TrainingSpec
from msgdrop_cli.engine import evaluation
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.archive import MANIFEST, contents, write_archive
from msgdrop_cli.records.packed import read_log
from msgdrop_cli.records.parsing import (
    LONGEST_LINE,
    MOST_COLUMNS,
    RECORD,
    TABLE,
    Bounds,
    parse_json,
    parse_rows,
)
from msgdrop_cli.records.seals import fingerprint, seal
from tests.cli_runs import python
from tests.fake_runs import write_run

_MOST_BYTES, _MOST_SECONDS = 256 * 2**20, 2.0
_READ = """
import pathlib, sys, tempfile, time
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.archive import unpack
from msgdrop_cli.records.store import list_runs

def peak():  # of this program: ru_maxrss would be that of the process which started it
    words = pathlib.Path("/proc/self/status").read_text().split()
    return 1024 * int(words[words.index("VmHWM:") + 1])

before, began = peak(), time.process_time()
path, said = pathlib.Path(sys.argv[1]), "accepted"
try:
    if path.suffix == ".zip":
        with tempfile.TemporaryDirectory() as folder:
            unpack(path, pathlib.Path(folder))
    else:
        list_runs(path)[0].metrics()
except RecordError as error:
    said = str(error)
print(peak() - before, time.process_time() - began, said)
"""


def run_with(folder: Path, name: str, content: bytes) -> Path:
    """A run with another file in it."""
    path = write_run(folder, "dcc", 1, catches={0.0: 3}).path
    (path / "metrics.jsonl").unlink()
    (path / name).write_bytes(content)
    return folder


def packed(row: bytes, rows: int) -> bytes:
    """A packed log of one row again and again, made without taking the memory either."""
    packer = zlib.compressobj(9, wbits=31)
    piece = row * 10_000
    parts = [packer.compress(piece) for _ in range(rows // 10_000)]
    return b"".join([*parts, packer.flush()])


def archive_with(folder: Path, name: str, content: bytes) -> Path:
    """A sealed archive of one run with another file in it."""
    record = write_run(folder, "dcc", 1, catches={0.0: 3})
    (record.path / "policy.safetensors").write_bytes(b"")
    write_archive(folder / "sound.zip", [record])
    with zipfile.ZipFile(folder / "sound.zip") as sound:
        files = {each: sound.read(each) for each in sound.namelist()}
    place = f"{record.environment}/{record.path.name}"
    files[f"{place}/{name}"] = content
    manifest = json.loads(files[MANIFEST])
    del manifest["seal"]
    manifest["runs"][place][name] = fingerprint(content)
    files[MANIFEST] = json.dumps(manifest | {"seal": seal(manifest)}).encode()
    with zipfile.ZipFile(folder / "bomb.zip", "w", zipfile.ZIP_DEFLATED) as bomb:
        for each, inside in files.items():
            bomb.writestr(each, inside)
    return folder / "bomb.zip"


def many_names(folder: Path) -> Path:
    """A zip of nothing but names."""
    with zipfile.ZipFile(folder / "names.zip", "w", zipfile.ZIP_DEFLATED) as bomb:
        for number in range(60_000):
            bomb.writestr(zipfile.ZipInfo(f"{number}"), b"")
    return folder / "names.zip"


BOMBS = {
    "packed rows": lambda at: run_with(at, "metrics.jsonl.gz", packed(b'{"env_steps":1}\n', 10**7)),
    "packed objects": lambda at: run_with(at, "metrics.jsonl.gz", packed(b"{}\n", 3 * 10**7)),
    "packed lines": lambda at: run_with(at, "metrics.jsonl.gz", packed(b"\n", 10**8)),
    "one packed line": lambda at: run_with(at, "metrics.jsonl.gz", packed(b"[", 3 * 10**7)),
    "plain rows": lambda at: run_with(at, "metrics.jsonl", b'{"env_steps":1}\n' * 2_000_000),
    "record of lists": lambda at: run_with(at, "run.json", b"[" + b"[],\n" * 6_000_000 + b"0]"),
    "record of text": lambda at: run_with(at, "run.json", b'"' + b"a \xc3\xa9" * 6_000_000 + b'"'),
    "archived log": lambda at: archive_with(at, "metrics.jsonl", b"{}\n" * 14_000_000),
    "archived record": lambda at: archive_with(at, "run.json", b"[" + b"[],\n" * 6_000_000 + b"0]"),
    "archived names": many_names,
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_bomb_costs_neither_memory_nor_time(tmp_path: Path, bomb: str) -> None:
    """It is refused in one line, with less than 256 MB more of memory and in less than 2 s."""
    done = python("-c", _READ, str(BOMBS[bomb](tmp_path)))
    used, seconds, said = done.stdout.split(" ", 2)
    assert str(tmp_path) in said, done.stderr
    assert len(said.splitlines()) == 1
    assert int(used) < _MOST_BYTES, said
    assert float(seconds) < _MOST_SECONDS, said


@pytest.mark.parametrize(
    ("name", "largest"), [("run.json", 2**16), ("MANIFEST.json", 2**20), ("log", 2**25)]
)
def test_an_archives_files_have_the_sizes_of_their_kinds(
    tmp_path: Path, name: str, largest: int
) -> None:
    """A record, a manifest, a log: one byte more than such a file can have is not unpacked."""
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as bomb:
        bomb.writestr(f"a/b/{name}", bytes(largest + 1))
    with pytest.raises(RecordError, match=f"'a/b/{name}' would unpack to more than {largest:,} "):
        contents(tmp_path / "a.zip")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[" * 17 + "]" * 17, "it is nested too deeply"),
        ('{"a":' * 17 + "1" + "}" * 17, "it is nested too deeply"),
        (json.dumps("x" * 1_001), "a text of 1,001 characters, expected 1,000 at most"),
        (json.dumps({"x" * 1_001: 1}), "a text of 1,001 characters, expected 1,000 at most"),
        (json.dumps([0] * 100), "it has more than 99 values"),
        (json.dumps([[]] * 50), "it has more than 99 values"),
        (" " * 5_000 + "1", "it has more than 5,000 bytes"),
    ],
)
def test_what_no_record_needs_is_refused(text: str, problem: str) -> None:
    """Depth, texts, values and bytes have their bounds."""
    with pytest.raises(RecordError) as caught:
        parse_json(text.encode(), "a", Bounds(5_000, 99))
    assert str(caught.value) == f"a: is damaged: {problem}"


@pytest.mark.parametrize(
    "text", ["[" * 16 + "]" * 16, json.dumps("x" * 1_000), json.dumps([0] * 99), " " * 4_999 + "1"]
)
def test_what_is_just_within_the_bounds_is_read(text: str) -> None:
    """One more of each is refused above."""
    assert parse_json(text.encode(), "a", Bounds(5_000, 99)) == json.loads(text)


@pytest.mark.parametrize(
    ("row", "problem"),
    [
        ({str(n): 0 for n in range(MOST_COLUMNS + 1)}, "it has more than 64 columns"),
        ({"x": []}, "it is nested too deeply"),
        ({"x": {}}, "it is nested too deeply"),
        ({"x": "x" * 1_001}, "a text of 1,001 characters, expected 1,000 at most"),
    ],
)
def test_a_row_is_flat_and_narrow(row: object, problem: str) -> None:
    """Rows are numbers and a few words by name."""
    with pytest.raises(RecordError) as caught:
        parse_rows([json.dumps(row).encode()], "a")
    assert str(caught.value) == f"a: line 1: is damaged: {problem}"


def test_a_log_has_a_bounded_number_of_names() -> None:
    """Rows share their columns' names; a name of its own for every value would fill the memory."""
    lines = (json.dumps({f"{n}": 0}).encode() for n in range(1_000))
    with pytest.raises(RecordError, match=r"line 257: .* more than 256 different columns"):
        parse_rows(lines, "a")


def test_rows_of_one_log_share_their_names() -> None:
    """Two rows, one text for the name of their column."""
    first, second = parse_rows([b'{"catches_per_500": 1}', b'{"catches_per_500": 2}'], "a")
    assert next(iter(first)) is next(iter(second))


def test_a_line_has_a_bounded_length(tmp_path: Path) -> None:
    """A row that fills it is read, one byte more is refused, and the line is named."""
    log, row = tmp_path / "a.jsonl", b'{"x":1'
    fill = LONGEST_LINE - len(row) - 2
    log.write_bytes(row + b" " * fill + b"}\n")
    assert read_log(log) == [{"x": 1}]
    log.write_bytes(b'{"x":1}\n' + row + b" " * (fill + 1) + b"}\n")
    with pytest.raises(RecordError, match=r"a\.jsonl: line 2: .* more than 4,096 bytes"):
        read_log(log)


def numbered(rows: int) -> Iterator[bytes]:
    """So many rows."""
    return (b'{"x":1}' for _ in range(rows))


def test_what_may_be_trained_may_be_read() -> None:
    """The longest log that a training may write is read, and none beyond it can be asked for."""
    longest: dict[str, Any] = {"train_env_steps": MOST_LOG_ROWS * 7, "log_every_env_steps": 7}
    assert TrainingSpec(**longest).train_env_steps == MOST_LOG_ROWS * 7
    assert len(parse_rows(numbered(MOST_LOG_ROWS), "a")) == MOST_LOG_ROWS
    with pytest.raises(ValueError, match="log_every_env_steps must be at least"):
        TrainingSpec(**longest | {"log_every_env_steps": 6})
    with pytest.raises(RecordError, match="line 100001: is damaged: more than 100,000 rows"):
        parse_rows(numbered(MOST_LOG_ROWS + 1), "a")


def test_what_may_be_played_may_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten evaluations of the most episodes fill a log; what has no room is not played."""
    assert MOST_LOG_ROWS == 10 * MOST_EPISODES
    check_episodes(MOST_EPISODES)
    with pytest.raises(DefinitionError, match="expected 1 to 10,000, not 10001"):
        check_episodes(MOST_EPISODES + 1)
    with pytest.raises(ValueError, match="evaluation_episodes must be at most 10,000"):
        Profile(seeds=1, evaluation_episodes=MOST_EPISODES + 1)
    record = write_run(tmp_path, "dcc", 1, catches={0.0: 3})  # two episodes, and no policy
    monkeypatch.setattr(evaluation, "MOST_LOG_ROWS", 5)
    with pytest.raises(RecordError, match="no more than 5 are kept of a run"):
        evaluation.evaluate_run(record.path, channel=Channel("links", (0.5,)), episodes=4)


def test_bounds_are_far_above_what_is_published() -> None:
    """Every published record has less than a tenth of what is read."""
    published = Path(__file__).resolve().parents[1] / "results" / "published"
    for file in published.rglob("*.json"):
        bounds = RECORD if file.name == "run.json" else TABLE
        content = file.read_bytes()
        assert 10 * len(content) < bounds.size
        assert 10 * sum(map(content.count, (b",", b"[", b"{"))) < bounds.values
    for file in published.rglob("*.jsonl.gz"):
        lines = gzip.decompress(file.read_bytes()).splitlines()
        assert 10 * len(lines) < MOST_LOG_ROWS
        assert 10 * max(map(len, lines)) < LONGEST_LINE
