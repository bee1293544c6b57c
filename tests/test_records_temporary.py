"""What is being written is nobody else's, and goes when its writer has been killed."""

import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest

from msgdrop_cli.records.files import write_bytes_atomic
from msgdrop_cli.records.temporary import new_file
from msgdrop_cli.signals import scratch_folder
from tests.cli_runs import python


def test_what_a_killed_process_was_writing_goes_with_the_next_file(tmp_path: Path) -> None:
    """Wherever it was, such as beside the references of games: no lock of a folder is needed."""
    program = (
        "import os, sys; from pathlib import Path\n"
        f"sys.path[:0] = {sys.path!r}\n"
        "from msgdrop_cli.records.temporary import new_file\n"
        "temporary, handle = new_file(Path(sys.argv[1]))\n"
        "os.write(handle, b'half a file')\n"
        "os.kill(os.getpid(), 9)\n"
    )
    subprocess.run([sys.executable, "-c", program, str(tmp_path / "references")], check=False)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"half a file"]
    write_bytes_atomic(tmp_path / "references", b"whole")
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"whole"]


def test_what_somebody_is_writing_and_what_is_not_ours_stays(tmp_path: Path) -> None:
    """Held, called otherwise, a link, a pipe, a folder."""
    held, handle = new_file(tmp_path / "file")
    place = tmp_path / "place"
    place.mkdir()
    kept = place / held.name
    held.rename(kept)
    (place / ".tmp-notes").touch()
    (place / f".tmp-{1:016x}").symlink_to(place / ".tmp-notes")
    os.mkfifo(place / f".tmp-{2:016x}")
    (place / f".tmp-{3:016x}").mkdir()
    before = {path.name for path in place.iterdir()}
    write_bytes_atomic(place / "new", b"")
    os.close(handle)
    assert {path.name for path in place.iterdir()} == before | {"new"}


def test_what_another_user_was_writing_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a shared folder, whoever might remove it: files and scratch folders."""
    file, folder = tmp_path / f".tmp-{1:016x}", tmp_path / ".tmp-folder"
    file.touch()
    folder.mkdir()
    os.utime(folder, (0, 0))
    monkeypatch.setattr(os, "getuid", lambda: file.stat().st_uid + 1)
    write_bytes_atomic(tmp_path / "new", b"")
    with scratch_folder(tmp_path, ".tmp-"):
        assert file.exists()
        assert folder.exists()


def test_a_file_that_was_removed_before_it_was_locked_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the two calls it looks as if it were abandoned."""
    lock, removed = fcntl.flock, list[Path]()

    def too_late(handle: int, kind: int) -> None:
        if not removed:
            removed.extend(tmp_path.glob(".tmp-*"))
            removed[0].unlink()
        lock(handle, kind)

    monkeypatch.setattr(fcntl, "flock", too_late)
    write_bytes_atomic(tmp_path / "file", b"whole")
    assert removed
    assert (tmp_path / "file").read_bytes() == b"whole"


@pytest.mark.parametrize("fails", [False, True])
def test_a_folder_is_never_gone_while_it_is_replaced(tmp_path: Path, fails: bool) -> None:
    """A signal between the two renames comes after them; if the second one fails, the old stays."""
    program = (
        "import os, signal, sys; from pathlib import Path\n"
        "from msgdrop_cli.records.temporary import put_in_place\n"
        "from msgdrop_cli.signals import end_at_once, scratch_folder\n"
        "end_at_once(); rename = Path.rename\n"
        "def between(path, target):\n"
        "    rename(path, target)\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "Path.rename = between\n"
        "with scratch_folder(Path(sys.argv[1])) as scratch:\n"
        "    (scratch / 'new').mkdir()\n"
        "    put_in_place(scratch / sys.argv[2], Path(sys.argv[1], 'target'))\n"
    )
    target = tmp_path / "target"
    target.mkdir()
    (target / "old").touch()
    assert python("-c", program, str(tmp_path), "missing" if fails else "new").returncode == 143
    assert [path.name for path in tmp_path.rglob("*")] == ["target", *(["old"] if fails else [])]
