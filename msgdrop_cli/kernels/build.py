"""Builds the C files of this room with the machine's compiler, once, and loads the library.

The compiled file lies in the user's cache folder under a name made of the sources, the flags, the
compiler and the processor, so it is never used where it does not belong. Loading it
is running it: a folder or file that somebody else could have written is not touched, and a folder
of this process alone is used instead.
`MSGDROP_KERNEL=torch` chooses the plain torch path, which gives the same numbers up to rounding.
"""

import atexit
import ctypes
import hashlib
import os
import platform
import shutil
import stat
import subprocess
import tempfile
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import cache
from pathlib import Path

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.kernels.structs import check_structs
from msgdrop_cli.signals import scratch_folder

_ROOM = Path(__file__).parent
_FLAGS = ("-O3", "-march=native", "-std=c11", "-fno-math-errno", "-fPIC", "-shared")
_WIDE = "-mprefer-vector-width=512"
"""Where there is AVX-512: tuned for an Intel gcc would take half of its width, a sixth slower."""
_ANSWERS_WITHIN_S, _BUILDS_WITHIN_S = 10, 120


def library() -> ctypes.CDLL | None:
    """The compiled functions, or None where there is no C compiler or they are not wanted.

    Raises DefinitionError if MSGDROP_KERNEL is neither `torch` nor unset; RuntimeError if a struct
    is not what structs.py says of it.
    """
    found = _loaded()
    return None if isinstance(found, str) else found


def why_torch() -> str | None:
    """Why nothing is compiled here, for people; None if it is."""
    found = _loaded()
    return found if isinstance(found, str) else None


@cache
def _loaded() -> ctypes.CDLL | str:
    """The library, or why there is none."""
    if wanted := os.environ.get("MSGDROP_KERNEL"):
        if wanted != "torch":
            raise DefinitionError(f"MSGDROP_KERNEL must be torch or not set, not {wanted[:64]!r}")
        return "MSGDROP_KERNEL=torch"
    if _processor().startswith(b"flags") and b"fma" not in _processor().split():  # an x86
        return "this processor has no fused multiply-adds"
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return "no C compiler: cc, gcc or clang"
    try:
        found = ctypes.CDLL(str(built(compiler, _ROOM)))
    except subprocess.TimeoutExpired as late:
        return f"{compiler} does not answer within {late.timeout:.0f} s"
    except subprocess.SubprocessError:
        return f"{compiler} cannot build the kernels"
    except OSError as error:
        return one_line(f"the kernels cannot be kept or loaded: {error}")
    check_structs(found)
    return found


def built(compiler: str, folder: Path) -> Path:
    """The library of all C files in a folder, compiled unless that was done before.

    Raises SubprocessError or OSError.
    """
    sources = sorted(folder.glob("*.c"))
    content = [path.read_bytes() for path in (*sources, *sorted(folder.glob("*.h")))]
    version, processor = _version(compiler), _processor()
    flags = (*_FLAGS, *([_WIDE] if b"avx512f" in processor.split() else []))
    recipe = b"\0".join((*content, " ".join(flags).encode(), version, processor))
    kept = kept_folder()
    library = kept / f"kernels-{hashlib.sha256(recipe).hexdigest()[:16]}.so"
    if _is_whole(library):
        return library
    with scratch_folder(kept) as scratch:
        output, seal = scratch / library.name, scratch / "seal"
        command = [compiler, *flags, *map(str, sources), "-o", str(output), "-lm"]
        nothing = subprocess.DEVNULL
        subprocess.run(
            command, stdout=nothing, stderr=nothing, check=True, timeout=_BUILDS_WITHIN_S
        )
        seal.write_text(_digest(output))
        for made in (output, seal):
            made.chmod(0o600)  # whatever the umask says
        output.replace(library)
        seal.replace(_seal_of(library))
    return library


def _version(compiler: str) -> bytes:
    """What the compiler says of itself; into a file, since a pipe waits for all that hold it."""
    with tempfile.TemporaryFile() as said:
        command = [compiler, "--version"]
        nothing = subprocess.DEVNULL
        subprocess.run(command, stdout=said, stderr=nothing, check=True, timeout=_ANSWERS_WITHIN_S)
        said.seek(0)
        return said.read()


def kept_folder() -> Path:
    """The folder in the user's cache, or one of this process alone if that cannot be relied on."""
    said = Path(os.environ.get("XDG_CACHE_HOME", ""))
    with suppress(OSError, RuntimeError):  # RuntimeError: there is no home
        # A relative one is to be ignored (XDG Base Directory Specification 0.8).
        folder = (said if said.is_absolute() else Path.home() / ".cache") / "msgdrop"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if _is_ours(folder, stat.S_ISDIR) and os.access(folder, os.W_OK):
            return folder
    return _private_folder()


@cache
def _private_folder() -> Path:
    """Gone when the process ends, however it does."""
    stack = ExitStack()
    atexit.register(stack.close)
    return stack.enter_context(scratch_folder())


def _is_ours(path: Path, kind: Callable[[int], bool]) -> bool:
    """Whether nobody else could have made or changed it; a link is of no kind."""
    facts = path.lstat()
    closed = not facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return kind(facts.st_mode) and facts.st_uid == os.geteuid() and closed


def _is_whole(library: Path) -> bool:
    """Whether it is ours and what was compiled: loading a torn one would kill the process."""
    seal = _seal_of(library)
    try:
        ours = _is_ours(library, stat.S_ISREG) and _is_ours(seal, stat.S_ISREG)
        return ours and seal.read_text() == _digest(library)
    except (OSError, ValueError):
        return False


def _seal_of(library: Path) -> Path:
    return library.with_suffix(".sha256")


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _processor() -> bytes:
    """What `-march=native` depends on."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line for line in lines if line.startswith(("flags", "Features"))).encode()
    except (OSError, StopIteration):
        return platform.processor().encode()
