"""`msgdrop doctor`: what it looks at, what it says of faults, and that it changes nothing."""

import fcntl
import json
import os
import resource
import shutil
import sys
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import pytest

from msgdrop_cli.commands.parts.doctor import folders, machine, software
from msgdrop_cli.commands.parts.doctor.check import Check, Found
from msgdrop_cli.engine import facts as engine_facts
from msgdrop_cli.kernels import build
from msgdrop_cli.records.store import RunRecord
from tests.cli_runs import msgdrop
from tests.fake_runs import write_run

CHECKS: dict[str, Check] = {
    check.name: check for group in (folders, machine, software) for check in group.CHECKS
}


def look(name: str, results: Path) -> Found:
    """What one check finds."""
    return CHECKS[name](results)


def no_file_system(*_: object, **__: object) -> object:
    """A folder that nothing can be written to."""
    raise PermissionError(13, "Permission denied")


def test_everything_is_looked_at_and_nothing_is_changed(tmp_path: Path) -> None:
    """More than 20 checks, each found in words; a results folder that is not there stays so."""
    said = msgdrop("doctor", "--results", tmp_path / "results", "--json")
    found = json.loads(said.out)
    assert len(found) >= 20
    assert {each["check"] for each in found} == {*CHECKS, "workers"}
    assert all(each["found"] for each in found)
    assert all(bool(each["fix"]) == (each["state"] != "fine") for each in found)
    assert said.code == (78 if "mend" in {each["state"] for each in found} else 0)
    assert list(tmp_path.iterdir()) == []


def test_a_check_that_fails_is_a_fault_itself(tmp_path: Path) -> None:
    """Whatever is broken is what the user wants to hear of; the other checks go on."""
    found = Check(name="x", look=lambda _: 1 / 0)(tmp_path)  # type: ignore[arg-type, return-value]
    assert found.state == "mend"
    assert "ZeroDivisionError" in found.words


def test_a_fault_has_its_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """78, with the line that says what to do, and a count at the end."""
    monkeypatch.setattr(machine, "free_memory", lambda: 1_000_000)
    said = msgdrop("doctor", "--results", tmp_path)
    assert said.code == 78
    assert "close other programs" in said.out
    assert "1 fault to mend" in said.out.splitlines()[-1]


def old_file(file: Path) -> None:
    """What somebody was writing in 1970."""
    file.parent.mkdir()
    file.touch()
    os.utime(file, (0, 0))


def linked(folder: Path) -> None:
    """A link to somewhere else."""
    folder.parent.mkdir()
    folder.symlink_to(folder.parent)


Make = Callable[[Path, pytest.MonkeyPatch], object]


def changed(where: object, name: str, value: object) -> Make:
    """Something of the machine or of a library is otherwise."""
    return lambda _, patch: patch.setattr(where, name, value)


def put(make: Callable[[Path], object]) -> Make:
    """Something stands in the results folder, or instead of it."""
    return lambda folder, _: make(folder / "results")


FAULTS: dict[str, tuple[str, Make]] = {
    "memory": ("mend", changed(machine, "free_memory", lambda: 10**6)),
    "processors": ("note", changed(os, "getloadavg", lambda: (99.0, 0, 0))),
    "open files": ("mend", changed(resource, "getrlimit", lambda _: (64, 64))),
    "file size": ("mend", changed(resource, "getrlimit", lambda _: (64, 64))),
    "clock": ("mend", changed(time, "gmtime", lambda: SimpleNamespace(tm_year=1970))),
    "clock of files": ("note", changed(time, "time", lambda: 0.0)),
    "umask": ("note", changed(os, "umask", lambda _: 0)),
    "results folder": ("mend", put(Path.touch)),
    "disk": ("mend", changed(shutil, "disk_usage", lambda _: SimpleNamespace(free=1))),
    "locks": ("note", changed(folders, "take_lock", lambda _: False)),
    "whole files": ("mend", changed(folders, "write_bytes_atomic", no_file_system)),
    "records": (
        "mend",
        put(lambda at: (write_run(at, "dcc", 1).path / "run.json").write_text("{")),
    ),
    "at work": ("note", put(lambda at: write_run(at, "dcc", 1, status="running"))),
    "leftovers": ("note", put(lambda at: old_file(at / ".tmp-1"))),
    "links": ("mend", put(lambda at: linked(at / "runs"))),
    "cache": ("note", changed(build, "kept_folder", lambda: Path("/scratch"))),
    "Python": ("mend", changed(sys, "version_info", (3, 9, 1))),
    "libraries": ("mend", changed(metadata, "version", lambda _: "0.1")),
    "constraints": ("note", changed(metadata, "version", lambda _: "0.1")),
    "C compiler": ("note", changed(shutil, "which", lambda _: None)),
    "kernels": ("note", changed(build, "_loaded", lambda: "no C compiler")),
    "commit": ("note", changed(engine_facts, "commit", lambda: None)),
}
"""How each fault is made, and what the check calls it."""


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found_with_its_fix(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Made on purpose, each is named by its check, with one line that says what to do."""
    state, make = FAULTS[name]
    with monkeypatch.context() as patch:
        make(tmp_path, patch)
        found = look(name, tmp_path / "results")
    assert found.state == state, found
    assert found.fix
    assert "\n" not in found.words + found.fix


def test_who_is_at_work_is_asked_of_the_kernel(tmp_path: Path) -> None:
    """A run whose lock is held is at work; no lock is taken to find out."""
    record: RunRecord = write_run(tmp_path, "dcc", 1, status="running")
    lock = record.path / "lock"
    with lock.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert look("at work", tmp_path).words == "1 run at work"
    assert "at which nobody works" in look("at work", tmp_path).words


def test_kernels_that_disagree_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other numbers than torch's are a fault; equal ones, up to rounding, are none."""
    assert look("kernels agree", tmp_path).state == "fine"
    from msgdrop_cli.algorithms.dcc import DCC

    exact = DCC.q_exec
    monkeypatch.setattr(DCC, "q_exec", lambda *a: exact(*a) + 0.01)
    assert look("kernels agree", tmp_path).state == "mend"


def test_no_worker_is_a_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What joblib said last is shown."""
    from msgdrop_cli.commands.parts.doctor import workers

    monkeypatch.setattr(workers, "_PROGRAM", "raise OSError('no semaphores')")
    found = workers.start()(tmp_path)
    assert (found.state, found.words) == ("mend", "joblib starts none: OSError: no semaphores")
