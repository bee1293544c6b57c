"""The machine, and what it lets this user do."""

import os
import resource
import sys
import tempfile
import time
from pathlib import Path

from msgdrop_cli.commands.parts.doctor.check import Check, Found, existing, fine, mend, note
from msgdrop_cli.commands.parts.estimate import free_memory
from msgdrop_cli.commands.parts.words import size

_A_RUN_BYTES = 600 * 2**20
"""What a worker takes with pursuit's full memory: libraries and run (benchmarks/NOTES.md)."""
_FEWEST_FILES, _FEWEST_PROCESSES = 256, 64
_FIRST_YEAR, _LAST_YEAR = 2025, 2100
_OUT_OF_STEP_S = 60.0


def _memory(_: Path) -> Found:
    free = free_memory()
    if free < _A_RUN_BYTES:
        return mend(f"{size(free)} free, a run takes {size(_A_RUN_BYTES)}", "close other programs")
    return fine(f"{size(free)} free, enough for {free // _A_RUN_BYTES:,} workers")


def _processors(_: Path) -> Found:
    count = len(os.sched_getaffinity(0))
    busy = os.getloadavg()[0]
    if busy > 1.5 * count:
        return note(f"{count}, with {busy:.1f} processes at work", "wait, or take fewer --workers")
    return fine(f"{count}, with {busy:.1f} processes at work")


def _files(_: Path) -> Found:
    return _limit(resource.RLIMIT_NOFILE, _FEWEST_FILES, "open files", "ulimit -n 1024")


def _processes(_: Path) -> Found:
    return _limit(resource.RLIMIT_NPROC, _FEWEST_PROCESSES, "processes", "ulimit -u 1024")


def _limit(which: int, fewest: int, what: str, fix: str) -> Found:
    allowed, _ = resource.getrlimit(which)
    if allowed == resource.RLIM_INFINITY:
        return fine("no limit")
    if allowed < fewest:
        return mend(f"{allowed:,} {what} are allowed, {fewest:,} may be needed", fix)
    return fine(f"{allowed:,} {what} are allowed")


def _file_size(_: Path) -> Found:
    allowed, _hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    if allowed != resource.RLIM_INFINITY:
        return mend(f"no file may have more than {size(allowed)}", "ulimit -f unlimited")
    return fine("no limit")


def _clock(_: Path) -> Found:
    year = time.gmtime().tm_year
    if not _FIRST_YEAR <= year <= _LAST_YEAR:
        return mend(f"it is {year}: records will name this date", "set the machine's clock")
    return fine(time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()))


def _clock_of_files(results: Path) -> Found:
    """`status` compares the two to say who is silent."""
    with tempfile.NamedTemporaryFile(dir=existing(results)) as file:
        apart = os.fstat(file.fileno()).st_mtime - time.time()
    if abs(apart) > _OUT_OF_STEP_S:
        return note(f"{apart:+.0f} s from ours: status may call runs silent", "ntpdate, or chrony")
    return fine("in step with ours")


def _proc(_: Path) -> Found:
    """Workers are told through it when to stop (`stopping.py`)."""
    from msgdrop_cli.stopping import graceful_stop

    with graceful_stop() as control:
        readable = not control.stopping()
    if not readable:
        return mend("nobody can be told to stop", "mount /proc")
    return fine("readable")


def _umask(_: Path) -> Found:
    mask = os.umask(0o022)
    os.umask(mask)
    if mask & 0o700:
        return mend(f"{mask:03o} closes new files to yourself", "umask 022")
    if mask & 0o002 == 0:
        return note(f"{mask:03o}: everybody may write into new records", "umask 022")
    return fine(f"{mask:03o}")


def _encoding(_: Path) -> Found:
    said = (sys.stdout.encoding or "ascii").lower()
    if "utf" not in said:
        return note(f"{said}: some letters become ?", "export LC_ALL=C.UTF-8")
    return fine(said)


def _temporary(_: Path) -> Found:
    with tempfile.NamedTemporaryFile() as file:
        file.write(b"x")
    return fine(tempfile.gettempdir())


CHECKS = (
    Check(name="memory", look=_memory),
    Check(name="processors", look=_processors),
    Check(name="open files", look=_files),
    Check(name="processes", look=_processes),
    Check(name="file size", look=_file_size),
    Check(name="clock", look=_clock),
    Check(name="clock of files", look=_clock_of_files),
    Check(name="/proc", look=_proc),
    Check(name="umask", look=_umask),
    Check(name="encoding", look=_encoding),
    Check(name="temporary files", look=_temporary),
)
