"""What network drives and shared folders refuse ends no run; links are never written through."""

import errno
import fcntl
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.commands.parts import estimate
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import (
    append_jsonl,
    cut_jsonl,
    read_json,
    remove_file,
    run_lock,
    sync_file,
    sync_folder,
    write_json_atomic,
)
from msgdrop_cli.records.references import keep_references
from tests.runs import planned


def refusing(number: int) -> Callable[..., int]:
    """A system call that fails with this error."""

    def call(*_: Any) -> int:
        raise OSError(number, os.strerror(number))

    return call


@pytest.fixture
def umask() -> Iterator[Callable[[int], int]]:
    """Sets the umask until the test ends."""
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


REFUSALS = [errno.EINVAL, errno.ENOTSUP, errno.ENOSYS, errno.EBADF, errno.EPERM]


@pytest.mark.parametrize("number", REFUSALS, ids=errno.errorcode.__getitem__)
def test_a_drive_that_syncs_nothing_is_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    """An fsync that is refused, of a file or of a folder, is a comfort less."""
    monkeypatch.setattr(os, "fsync", refusing(number))
    write_json_atomic(tmp_path / "a.json", {"x": 1})
    append_jsonl(tmp_path / "a.jsonl", {"x": 1}, {"x": 2})
    cut_jsonl(tmp_path / "a.jsonl", 1)
    sync_file(tmp_path / "a.jsonl")
    sync_folder(tmp_path)
    assert read_json(tmp_path / "a.json") == {"x": 1}
    assert (tmp_path / "a.jsonl").read_text() == '{"x": 1}\n'


def test_a_folder_that_cannot_be_opened_needs_no_sync(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One may be allowed to write into a folder that one may not read."""
    monkeypatch.setattr(os, "open", refusing(errno.EACCES))
    sync_folder(tmp_path)


@pytest.mark.parametrize("number", [errno.EIO, errno.EDQUOT], ids=["EIO", "EDQUOT"])
def test_a_fault_of_the_disk_is_a_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    """An fsync that says so is the only one who knows that the data is lost."""
    append_jsonl(tmp_path / "a.jsonl", {"x": 1})
    monkeypatch.setattr(os, "fsync", refusing(number))
    with pytest.raises(RecordError) as caught:
        sync_file(tmp_path / "a.jsonl")
    assert caught.value.exit_code == 74


@pytest.mark.parametrize(("mask", "mode"), [(0o002, 0o664), (0o022, 0o644), (0o077, 0o600)])
def test_modes_follow_the_umask(
    tmp_path: Path, umask: Callable[[int], int], mask: int, mode: int
) -> None:
    """A group can go on with a run, the lock included, and what is private stays so."""
    umask(mask)
    path = tmp_path / "runs" / "run"
    with run_lock(path):
        write_json_atomic(path / "run.json", {})
        append_jsonl(path / "metrics.jsonl", {"x": 1})
    assert {file.stat().st_mode & 0o777 for file in path.iterdir()} == {mode}
    assert path.stat().st_mode & 0o777 == 0o777 & ~mask


NO_LOCKS = [errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EINVAL]


@pytest.mark.parametrize("number", NO_LOCKS, ids=errno.errorcode.__getitem__)
def test_a_drive_without_locks_is_trained_on(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    number: int,
) -> None:
    """A note says what nobody guards there; nothing else is said, and the run goes on."""
    monkeypatch.setattr(fcntl, "flock", refusing(number))
    estimate.check_folder(tmp_path, 0)
    with run_lock(tmp_path / "run"):
        pass
    note = f"{tmp_path}: has no locks: start no second command that trains here\n"
    assert capsys.readouterr() == ("", note)


def test_a_disk_that_turns_read_only_loses_no_outcome(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither a row nor a word in the record can be written: that is said (74), with the others.

    The kernel does so after an error of the disk.
    """
    opened, refuse = os.open, refusing(errno.EROFS)

    def open_to_read(path: Path, flags: int, *mode: int) -> int:
        writes = flags & (os.O_WRONLY | os.O_RDWR)
        return refuse() if writes and tmp_path in Path(path).parents else opened(path, flags, *mode)

    def turn_read_only() -> bool:
        monkeypatch.setattr(os, "unlink", refuse)
        monkeypatch.setattr(os, "open", open_to_read)
        return False

    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
    train_cohort([planned()], tmp_path)
    done, failed = train_cohort([planned(), planned(seed=2)], tmp_path, stop=turn_read_only)
    assert (done.status, failed.status, failed.exit_code) == ("done", "failed", 74)


def test_what_cannot_be_removed_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it lies and why, as of what cannot be written; what is not there is removed already."""
    remove_file(tmp_path / "none")
    monkeypatch.setattr(os, "unlink", refusing(errno.EROFS))
    with pytest.raises(RecordError, match="a: cannot be removed: Read-only file system") as caught:
        remove_file(tmp_path / "a")
    assert caught.value.exit_code == 74


def test_a_drive_with_locks_needs_no_note(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As on every ordinary disk."""
    estimate.check_folder(tmp_path, 0)
    assert capsys.readouterr() == ("", "")


def test_no_file_is_written_through_a_link(tmp_path: Path) -> None:
    """Whoever sent a folder does not decide which file of ours is written to."""
    mine = tmp_path / "mine"
    mine.write_text('{"x": 1}\n{"x": 2}\n')
    run = tmp_path / "run"
    run.mkdir()
    for name in ("run.json", "metrics.jsonl", "lock"):
        (run / name).symlink_to(mine)
    with pytest.raises(RecordError):
        append_jsonl(run / "metrics.jsonl", {"x": 3})
    for keep in (0, 1):
        with pytest.raises(RecordError):
            cut_jsonl(run / "metrics.jsonl", keep)
    with pytest.raises(RecordError), run_lock(run):
        pass
    write_json_atomic(run / "run.json", {})
    assert not (run / "run.json").is_symlink()
    assert mine.read_text() == '{"x": 1}\n{"x": 2}\n'


def test_no_dangling_link_becomes_a_file(tmp_path: Path) -> None:
    """Not even where nothing stands yet."""
    for name in ("metrics.jsonl", "lock"):
        (tmp_path / name).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(RecordError):
        append_jsonl(tmp_path / "metrics.jsonl", {"x": 1})
    with pytest.raises(RecordError):
        cut_jsonl(tmp_path / "metrics.jsonl", 0)
    with pytest.raises(RecordError), run_lock(tmp_path):
        pass
    assert not (tmp_path / "elsewhere").exists()


def test_a_pipe_keeps_nobody_waiting(tmp_path: Path) -> None:
    """A log that is somebody's pipe is refused at once."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(RecordError, match="pipe: cannot be written"):
        append_jsonl(tmp_path / "pipe", {"x": 1})


def test_reference_policies_are_not_kept_through_a_linked_folder(tmp_path: Path) -> None:
    """They are played again next time."""
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "references").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(RecordError, match="is a symbolic link"):
        keep_references(tmp_path, "game-1", {})
    assert list((tmp_path / "elsewhere").iterdir()) == []
