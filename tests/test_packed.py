"""Packed logs read as the others do, and damage is one line."""

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records import packed
from msgdrop_cli.records.files import append_jsonl
from msgdrop_cli.records.packed import log_bytes, pack, packed_name, read_log

ROWS: list[dict[str, Any]] = [{"env_steps": 5, "loss": 0.25}, {"env_steps": 10, "loss": None}]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A log, and its packed copy beside it."""
    path = tmp_path / "metrics.jsonl"
    append_jsonl(path, *ROWS)
    (tmp_path / packed_name(path.name)).write_bytes(pack(path.read_bytes()))
    return path


def test_a_packed_log_has_the_same_rows(log: Path) -> None:
    """Once the log itself is gone, its packed copy says the same."""
    log.unlink()
    assert read_log(log) == ROWS


def test_the_log_itself_goes_first(log: Path) -> None:
    """What was added to it since is seen."""
    append_jsonl(log, {"env_steps": 15})
    assert len(read_log(log)) == 3


def test_no_log_has_no_rows(tmp_path: Path) -> None:
    """As before a run's first window."""
    assert read_log(tmp_path / "metrics.jsonl") == []
    assert log_bytes(tmp_path / "metrics.jsonl") is None


def test_packing_gives_the_same_bytes_again(log: Path) -> None:
    """No time and no name goes in, so publishing again changes nothing."""
    content = pack(log.read_bytes())
    assert content == log.with_name(packed_name(log.name)).read_bytes()
    assert content[4:8] == bytes(4)  # where gzip would put the time


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: content[:-9],
        lambda content: b"",
        lambda content: b"no gzip at all",
        lambda content: content[:10] + bytes([content[10] | 6]) + content[11:],
        lambda content: gzip.compress(b"[1]\n"),
    ],
    ids=["torn", "empty", "other", "flipped", "no object"],
)
def test_a_damaged_one_is_one_line(log: Path, damage: Callable[[bytes], bytes]) -> None:
    """The line names the file."""
    file = log.with_name(packed_name(log.name))
    file.write_bytes(damage(file.read_bytes()))
    log.unlink()
    with pytest.raises(RecordError) as error:
        read_log(log)
    assert str(error.value).startswith(str(file))
    assert "\n" not in str(error.value)


def test_what_unpacks_to_no_end_is_refused(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A few packed bytes cannot fill the memory."""
    monkeypatch.setattr(packed, "LARGEST_FILE", 20)
    log.unlink()
    with pytest.raises(RecordError, match="it unpacks to more than 20 bytes"):
        read_log(log)
