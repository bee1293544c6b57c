"""Trials on disks that are full, read-only, missing, or no folder at all."""

import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tests.faults.row import NotHere, Trial, expect
from tests.faults.study import command, go_on, seconds_undisturbed, start

_SIZE = 96 * 2**20
_REFUSED_WITHIN_S = 1.0


def fill_the_disk(trial: Trial) -> None:
    """The disk is full from some moment on: 74, the checkpoint before is good."""
    with _disk(trial.folder / "disk", f"size={_SIZE}") as disk:
        again = command(trial.bench, disk / "results")
        process = start(again, trial.folder)
        time.sleep(trial.rng.uniform(0.0, seconds_undisturbed(trial)))
        _fill(disk / "ballast")
        code = process.wait()
        expect(code in (0, 74), f"ended with {code}: {process.last_line()}")
        expect("Traceback" not in process.said, "a traceback was shown")
        if code == 74:
            words = ("No space left", "bytes) of disk")
            expect(any(word in process.said for word in words), f"said {process.last_line()}")
        (disk / "ballast").unlink()
        go_on(trial, again)


def refuse_a_small_disk(trial: Trial) -> float:
    """Too little from the start: 74 with needed and free bytes, before anything is written."""
    with _disk(trial.folder / "disk", "size=1m") as disk:
        began = time.monotonic()
        process = start(command(trial.bench, disk / "results"), trial.folder)
        code = process.wait()
        expect(code == 74, f"ended with {code}: {process.last_line()}")
        expect("bytes) of disk" in process.said, f"said {process.last_line()}")
        expect(not list(disk.rglob("run.json")), "a run was begun")
        return time.monotonic() - began


def refuse_what_is_no_folder(trial: Trial) -> float:
    """Read-only, a file, a dangling link, a circle of links, a folder below a file."""
    kinds = (_read_only, _a_file, _below_a_file, _a_circle, _too_long)
    with kinds[trial.number % len(kinds)](trial.folder) as results:
        began = time.monotonic()
        process = start(command(trial.bench, results), trial.folder)
        code = process.wait()
        took = time.monotonic() - began
    expect(code in (73, 74, 2), f"{results.name}: ended with {code}: {process.last_line()}")
    expect("Traceback" not in process.said, "a traceback was shown")
    expect("training     DCC" not in process.said, "the training had begun")
    return took


@contextmanager
def _disk(folder: Path, options: str) -> Iterator[Path]:
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    if subprocess.run(mount, capture_output=True).returncode:
        raise NotHere("no tmpfs can be mounted (it takes root)")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def _fill(ballast: Path) -> None:
    """Take what is left of the disk, to the last page."""
    with ballast.open("wb", buffering=0) as file, suppress(OSError):
        while file.write(bytes(2**20)):
            pass


@contextmanager
def _read_only(folder: Path) -> Iterator[Path]:
    with _disk(folder / "read-only", "ro") as disk:
        yield disk / "results"


@contextmanager
def _a_file(folder: Path) -> Iterator[Path]:
    (folder / "a-file").touch()
    yield folder / "a-file"


@contextmanager
def _below_a_file(folder: Path) -> Iterator[Path]:
    (folder / "a-file").touch()
    yield folder / "a-file" / "results"


@contextmanager
def _a_circle(folder: Path) -> Iterator[Path]:
    (folder / "circle").symlink_to(folder / "back")
    (folder / "back").symlink_to(folder / "circle")
    yield folder / "circle"


@contextmanager
def _too_long(folder: Path) -> Iterator[Path]:
    yield folder / ("x" * (os.pathconf(folder, "PC_NAME_MAX") + 1))
