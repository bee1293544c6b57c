"""The results folder, what lies in it, and the caches."""

import os
import shutil
import tempfile
import time
from pathlib import Path

from msgdrop_cli.commands.parts.doctor.check import Check, Found, existing, fine, mend, note
from msgdrop_cli.commands.parts.words import counted, several, size
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import LOCK, take_lock, write_bytes_atomic
from msgdrop_cli.records.holders import is_held, locked_files
from msgdrop_cli.records.store import RUNS, RunRecord, look_through
from msgdrop_cli.records.temporary import TEMPORARY

_ENOUGH_BYTES = 2 * 2**30
"""Two runs at work with a million steps of memory; the plan of a command says it exactly."""
_SLOW_SYNC_S = 0.1
_OLD_S = 3_600.0


def _writable(results: Path) -> Found:
    place = existing(results)
    if results.exists() and place != results.absolute():
        return mend(f"{results} is no folder", "name another one with --results")
    with tempfile.TemporaryFile(dir=place):
        pass
    return fine(str(place) if place == results.absolute() else f"{results} can be made")


def _disk(results: Path) -> Found:
    free = shutil.disk_usage(existing(results)).free
    if free < _ENOUGH_BYTES:
        return mend(f"{size(free)} free, two long runs may fill {size(_ENOUGH_BYTES)}", "make room")
    return fine(f"{size(free)} free")


def _inodes(results: Path) -> Found:
    free = os.statvfs(existing(results))
    if free.f_files and free.f_favail < 1_000:
        return mend(f"only {free.f_favail:,} more files fit there", "delete files, or ask for more")
    return fine("enough")


def _locks(results: Path) -> Found:
    with (
        tempfile.NamedTemporaryFile(dir=existing(results)) as file,
        Path(file.name).open() as other,
    ):
        if not take_lock(file.fileno()):
            return note("none there: nobody guards a run", "never start two commands that train")
        try:
            take_lock(other.fileno())
        except BlockingIOError:
            return fine("one writer a run")
    return mend("two can hold one lock there", "take a --results folder on another disk")


def _atomic(results: Path) -> Found:
    """A whole file replaces another one, and stays after a power cut: how long that takes."""
    with tempfile.TemporaryDirectory(dir=existing(results), prefix=TEMPORARY) as folder:
        file = Path(folder) / "file"
        began = time.monotonic()
        for content in (b"old", b"new"):
            write_bytes_atomic(file, content)
        took = (time.monotonic() - began) / 2
        if file.read_bytes() != b"new":
            return mend("a file that was replaced is the old one", "take another disk")
    if took > _SLOW_SYNC_S:
        fix = "a disk of this machine is faster than a network drive"
        return note(f"{1e3 * took:.0f} ms a file: checkpoints are slow", fix)
    return fine(f"{1e3 * took:.0f} ms a file")


def _records(results: Path) -> Found:
    """Own ones and published ones."""
    runs = counted([record.run_id for record in _runs(results)])
    return fine(f"{runs}, own and published: readable")


def _at_work(results: Path) -> Found:
    """Who holds a run's lock, by the kernel's list: no lock is taken to find out."""
    held = locked_files()
    running = [record for record in _runs(results) if record.status == "running"]
    busy = [record for record in running if is_held(record.path / LOCK, held)]
    if killed := len(running) - len(busy):
        words = f"{several(killed, 'run')} at which nobody works: it was killed"
        return note(
            words,
            "the command that began it goes on from its checkpoint, or anew if it has none yet",
        )
    if busy:
        return note(f"{several(len(busy), 'run')} at work", "wait, or train other runs meanwhile")
    return fine("nobody")


def _leftovers(results: Path) -> Found:
    """What a kill left; the next command that writes there removes it."""
    now = time.time()
    found = [
        path
        for path in (results.rglob(f"{TEMPORARY}*") if results.is_dir() else ())
        if now - path.lstat().st_mtime > _OLD_S
    ]
    if found:
        fix = "the command that writes there again removes them; or delete them yourself"
        return note(f"{several(len(found), 'temporary file')}, such as {found[0]}", fix)
    return fine("none")


def _links(results: Path) -> Found:
    """Nothing is written through a link in a results folder."""
    if (results / RUNS).is_symlink():
        return mend(f"{results / RUNS} is a link", "put a folder there, or name its target")
    return fine("none in the way")


def _cache(_: Path) -> Found:
    from msgdrop_cli.kernels.build import kept_folder

    folder = kept_folder()
    if folder.name != "msgdrop":
        fix = "export XDG_CACHE_HOME to a folder that only you can write"
        return note("no folder of yours: kernels are compiled anew by every command", fix)
    return fine(str(folder))


def _fonts(_: Path) -> Found:
    import matplotlib

    folder = Path(matplotlib.get_cachedir())
    if not os.access(folder, os.W_OK):
        return note(f"{folder} cannot be written", "export MPLCONFIGDIR to a folder of yours")
    if not any(folder.glob("fontlist-*.json")):
        return note("not listed yet: the first figure takes longer", "msgdrop plot, once")
    return fine(str(folder))


def _runs(results: Path) -> list[RunRecord]:
    """All runs there, published ones included; none in a folder without any."""
    if not results.is_dir():
        return []
    try:
        return look_through(results).records
    except RecordError as error:
        if "holds no runs" in str(error):
            return []
        raise


CHECKS = (
    Check(name="results folder", look=_writable),
    Check(name="disk", look=_disk),
    Check(name="room for files", look=_inodes),
    Check(name="locks", look=_locks),
    Check(name="whole files", look=_atomic),
    Check(name="records", look=_records),
    Check(name="at work", look=_at_work),
    Check(name="leftovers", look=_leftovers),
    Check(name="links", look=_links),
    Check(name="cache", look=_cache),
    Check(name="fonts", look=_fonts),
)
