"""Files of the results store: whole or not at all, and never trusted."""

import errno
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import (
    Epoch,
    append_jsonl,
    cut_jsonl,
    read_bytes,
    read_json,
    run_lock,
    write_json_atomic,
)
from msgdrop_cli.records.listings import listed
from msgdrop_cli.records.packed import read_log


def full_disk(*_: Any) -> int:
    """Fails as a full disk does."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_what_is_written_is_read(tmp_path: Path) -> None:
    """A value comes back equal, with or without fsync, and leaves no other file."""
    for durable in (True, False):
        write_json_atomic(tmp_path / "a.json", {"x": [1, 2.5, None]}, durable=durable)
        assert read_json(tmp_path / "a.json") == {"x": [1, 2.5, None]}
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_full_disk_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    """If a call fails the old value stays, nothing temporary is left, and the exit code is 74."""
    write_json_atomic(tmp_path / "a.json", "old")
    monkeypatch.setattr(os, call, full_disk)
    with pytest.raises(RecordError, match="cannot be written: No space left") as caught:
        write_json_atomic(tmp_path / "a.json", "new")
    assert caught.value.exit_code == 74
    assert read_json(tmp_path / "a.json") == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


def test_nan_is_never_written(tmp_path: Path) -> None:
    """NaN breaks the readers of JSON: it is a mistake of ours."""
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json_atomic(tmp_path / "a.json", float("nan"))
    with pytest.raises(ValueError, match="not JSON compliant"):
        append_jsonl(tmp_path / "a.jsonl", {"x": float("inf")})
    assert list(tmp_path.iterdir()) == []


def test_rows_are_appended(tmp_path: Path) -> None:
    """One row and several rows, in order."""
    append_jsonl(tmp_path / "a.jsonl", {"x": 1})
    append_jsonl(tmp_path / "a.jsonl", {"x": 2}, {"x": 3})
    assert read_log(tmp_path / "a.jsonl") == [{"x": 1}, {"x": 2}, {"x": 3}]


def test_numbers_of_64_bits_are_read(tmp_path: Path) -> None:
    """The largest number that a record may hold, and the same below zero."""
    for number in (2**63 - 1, 1 - 2**63):
        (tmp_path / "a").write_text(str(number))
        assert read_json(tmp_path / "a") == number


def test_a_write_that_the_disk_cuts_short_leaves_no_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A short write is taken back and reported with 74."""
    append_jsonl(tmp_path / "a.jsonl", {"x": 1})
    write = os.write
    monkeypatch.setattr(os, "write", lambda handle, content: write(handle, content[:4]))
    with pytest.raises(RecordError) as caught:
        append_jsonl(tmp_path / "a.jsonl", {"x": 2})
    assert caught.value.exit_code == 74
    assert (tmp_path / "a.jsonl").read_text() == '{"x": 1}\n'


def test_a_torn_last_line_is_left_out(tmp_path: Path) -> None:
    """What a crash cut off in the middle was never logged."""
    (tmp_path / "a.jsonl").write_text('{"x": 1}\n{"x": 2')
    assert read_log(tmp_path / "a.jsonl") == [{"x": 1}]


@pytest.mark.parametrize(
    "line",
    [
        *("{", "", "[1]", '{"x": NaN}', '{"x": 1e999}', "{}{}", "[" * 9999),
        *('{"x": 9223372036854775808}', '{"x": -1' + "0" * 5000 + "}"),
    ],
)
def test_any_other_damage_names_file_and_line(tmp_path: Path, line: str) -> None:
    """A bad line with lines after it is no accident of a crash."""
    path = tmp_path / "a.jsonl"
    path.write_text(f'{{"x": 1}}\n{line}\n{{"x": 3}}\n')
    with pytest.raises(RecordError, match=r"a\.jsonl: line 2: ") as caught:
        read_log(path)
    assert str(caught.value).isprintable()


def test_a_log_is_cut_back_to_the_rows_of_a_checkpoint(tmp_path: Path) -> None:
    """Later rows and a torn end go; the next row follows without gap or duplicate."""
    path = tmp_path / "a.jsonl"
    path.write_text('{"x": 1}\n{"x": 2}\n{"x": 3}\n{"x"')
    cut_jsonl(path, 2)
    append_jsonl(path, {"x": 9})
    assert path.read_text() == '{"x": 1}\n{"x": 2}\n{"x": 9}\n'


def test_a_log_shorter_than_its_checkpoint_is_damage(tmp_path: Path) -> None:
    """The rows cannot be made up; a log that is not there has none."""
    (tmp_path / "a.jsonl").write_text('{"x": 1}\n{"x"')
    with pytest.raises(RecordError, match="expected 2 rows, only 1 are whole"):
        cut_jsonl(tmp_path / "a.jsonl", 2)
    cut_jsonl(tmp_path / "missing.jsonl", 0)


@pytest.mark.parametrize("name", ["missing", "folder", "loop", "link", "pipe", "bad", "deep"])
def test_what_is_no_record_is_refused(tmp_path: Path, name: str) -> None:
    """Missing, a folder, a link to itself or elsewhere, a pipe, no JSON: one printable line."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "good").write_text("{}")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "link").symlink_to(tmp_path / "good")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "bad").write_bytes(b"\x80\x04N.")
    (tmp_path / "deep").write_text("[" * 100_000)
    with pytest.raises(RecordError, match=f"{name}: ") as caught:
        read_json(tmp_path / name)
    assert (str(caught.value).isprintable(), caught.value.exit_code) == (True, 2)


def test_a_pipe_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    """Nor a device: for the superuser /dev/null would be a file from then on."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(RecordError, match="pipe: is there and is no file") as caught:
        write_json_atomic(tmp_path / "pipe", {})
    assert caught.value.exit_code == 73
    assert (tmp_path / "pipe").is_fifo()


def test_texts_come_back_without_control_characters(tmp_path: Path) -> None:
    """An escape sequence in somebody's record does not reach the terminal."""
    (tmp_path / "a").write_text(json.dumps({"a\x1b[2J": ["b\x07\n", "\u202ec"]}))
    assert read_json(tmp_path / "a") == {"a [2J": ["b", "c"]}


def test_a_run_in_use_is_busy_for_others(tmp_path: Path) -> None:
    """Another process gets 75 while the lock is held, and the lock afterwards."""
    program = (
        "import sys; from pathlib import Path\n"
        f"sys.path[:0] = {sys.path!r}\n"
        "from msgdrop_cli.records.files import run_lock\n"
        "from msgdrop_cli.errors import RecordError\n"
        "try:\n    with run_lock(Path(sys.argv[1])): pass\n"
        "except RecordError as error: sys.exit(error.exit_code)\n"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "run")]
    with run_lock(tmp_path / "run"):
        assert subprocess.run(command, check=False).returncode == 75
    assert subprocess.run(command, check=False).returncode == 0


def test_the_lock_of_a_killed_process_is_free_and_its_leftovers_go(tmp_path: Path) -> None:
    """Nothing has to be unlocked or cleaned by hand."""
    (tmp_path / "lock").write_text("")
    (tmp_path / ".tmp-abc").write_text("half a file")
    with run_lock(tmp_path):
        assert [path.name for path in tmp_path.iterdir()] == ["lock"]


def test_a_folder_that_cannot_be_made_is_73(tmp_path: Path) -> None:
    """A file stands where the folder should be."""
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(RecordError, match="cannot be created") as caught,
        run_lock(tmp_path / "file" / "run"),
    ):
        pass
    assert caught.value.exit_code == 73


@pytest.mark.parametrize("look", ["file", "folder", "epoch"])
def test_a_disk_that_fails_is_a_fault_of_the_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, look: str
) -> None:
    """74, whatever was tried: neither damage, nor another process at work."""

    def fail(*_: object) -> int:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    tries: dict[str, Callable[[Epoch], object]] = {
        "file": lambda _: read_bytes(tmp_path / "lock"),
        "folder": lambda _: listed(tmp_path),
        "epoch": lambda epoch: epoch.check(),
    }
    with run_lock(tmp_path) as epoch, monkeypatch.context() as patched:
        patched.setattr(os, "scandir" if look == "folder" else "open", fail)
        with pytest.raises(RecordError, match="cannot be read: Input/output error") as caught:
            tries[look](epoch)
    assert caught.value.exit_code == 74
