"""Signals where nothing is at work: which are heeded, and what they leave behind."""

import fcntl
import os
import signal
import subprocess
from pathlib import Path

import pytest

from msgdrop_cli.signals import SIGNALS, end_at_once, held_back, scratch_folder
from msgdrop_cli.stopping import graceful_stop
from tests.cli_runs import python


@pytest.mark.parametrize("ignored", SIGNALS)
def test_what_was_ignored_at_the_start_stays_ignored(ignored: signal.Signals) -> None:
    """`nohup` and background jobs: neither the program nor its work takes the signal back."""
    before = {each: signal.getsignal(each) for each in SIGNALS}
    try:
        signal.signal(ignored, signal.SIG_IGN)
        end_at_once()
        with graceful_stop():
            heeded = [each for each in SIGNALS if signal.getsignal(each) is not signal.SIG_IGN]
            assert heeded == [each for each in SIGNALS if each is not ignored]
        assert signal.getsignal(ignored) is signal.SIG_IGN
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def test_processes_never_get_what_is_held_back() -> None:
    """Not even one that has no handler yet; this process gets it afterwards."""
    arrived = []
    before = signal.signal(signal.SIGHUP, lambda *_: arrived.append(1))
    shell = ["sh", "-c", f"kill -HUP $$ {os.getpid()}; echo alive"]
    try:
        with held_back():
            assert subprocess.run(shell, capture_output=True, check=True).stdout == b"alive\n"
        assert arrived
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize(("signum", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_a_signal_while_the_program_loads_ends_it(signum: str, code: int) -> None:
    """At once and with a word, whatever an import would make of an exception."""
    program = (
        "import os, signal; from msgdrop_cli import __main__\n"
        "def load(_):\n"
        "    try:\n"
        f"        os.kill(os.getpid(), signal.{signum})\n"
        "    except BaseException as error:\n"
        "        raise ImportError('numpy failed') from error\n"
        "__main__.greeting = load; __main__.main()\n"
    )
    done = python("-c", program)
    assert (done.returncode, done.stdout, done.stderr) == (code, "", "stopped\n")


@pytest.mark.parametrize("times", [1, 2])
def test_a_signal_removes_temporary_folders(tmp_path: Path, times: int) -> None:
    """Outside of work the first, at work the second one ends the program: nothing is left."""
    program = (
        "import os, signal, sys; from contextlib import nullcontext; from pathlib import Path\n"
        "from msgdrop_cli.signals import end_at_once, scratch_folder\n"
        "from msgdrop_cli.stopping import graceful_stop\n"
        "folder, times = Path(sys.argv[1]), int(sys.argv[2])\n"
        "end_at_once()\n"
        "with scratch_folder(folder), nullcontext() if times == 1 else graceful_stop():\n"
        "    print(len(list(folder.iterdir())), flush=True)\n"
        "    for _ in range(times): os.kill(os.getpid(), signal.SIGTERM)\n"
    )
    done = python("-c", program, str(tmp_path), str(times))
    assert (done.returncode, done.stdout) == (143, "1\n"), done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("prefix", ["msgdrop-scratch-", ".tmp-"])
def test_scratch_folders_of_the_dead_are_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, prefix: str
) -> None:
    """Ours only: neither what somebody holds, nor young ones, nor links, nor other names."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "results").mkdir()
    for name in ("dead", "held", "young"):
        (tmp_path / f"{prefix}{name}").mkdir()
    (tmp_path / f"{prefix}dead" / "policy").touch()
    for name in ("dead", "held"):
        os.utime(tmp_path / f"{prefix}{name}", (0, 0))
    (tmp_path / f"{prefix}link").symlink_to(tmp_path / "results")
    held = os.open(tmp_path / f"{prefix}held", os.O_RDONLY)
    fcntl.flock(held, fcntl.LOCK_SH)
    with scratch_folder() if "scratch" in prefix else scratch_folder(tmp_path, prefix) as ours:
        assert ours.is_dir()
    os.close(held)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"results", *(f"{prefix}{name}" for name in ("held", "young", "link"))}
