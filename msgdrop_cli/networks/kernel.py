"""Builds a C file with the machine's compiler, once, and loads it; without a compiler: None.

The compiled file lies in the user's cache folder under a name made of the source with its headers,
the flags, the compiler and the processor, so it is never used where it does not belong.
`MSGDROP_KERNEL=torch` chooses the plain torch path, which gives the same numbers up to rounding
(test_compiled).
"""

import ctypes
import hashlib
import os
import platform
import re
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import DefinitionError

_FLAGS = ("-O3", "-march=native", "-std=c11", "-fno-math-errno", "-fPIC", "-shared")


def load(source: Path) -> ctypes.CDLL | None:
    """The compiled file, or None where there is no C compiler or it is not wanted.

    Raises DefinitionError if MSGDROP_KERNEL is neither `torch` nor unset.
    """
    found = _loaded(source)
    return None if isinstance(found, str) else found


def why_torch() -> str | None:
    """Why nothing is compiled here, for people; None if it is."""
    found = _loaded(Path(__file__).with_name("sparse_rows.c"))
    return found if isinstance(found, str) else None


@cache
def _loaded(source: Path) -> ctypes.CDLL | str:
    """The compiled file, or why there is none."""
    if wanted := os.environ.get("MSGDROP_KERNEL"):
        if wanted != "torch":
            raise DefinitionError(f"MSGDROP_KERNEL must be torch or not set, not {wanted[:64]!r}")
        return "MSGDROP_KERNEL=torch"
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return "no C compiler: cc, gcc or clang"
    try:
        return ctypes.CDLL(str(_built(compiler, source)))
    except subprocess.SubprocessError:
        return f"{compiler} cannot build {source.name}"
    except (OSError, RuntimeError) as error:  # RuntimeError: there is no home
        return one_line(f"{source.name} cannot be kept or loaded: {error}")


def _built(compiler: str, source: Path) -> Path:
    version = subprocess.run([compiler, "--version"], capture_output=True, check=True).stdout
    parts = (_with_headers(source), " ".join(_FLAGS).encode(), version, _processor())
    recipe = b"\0".join(parts)
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "msgdrop"
    library = folder / f"{source.stem}-{hashlib.sha256(recipe).hexdigest()[:16]}.so"
    if not _is_whole(library):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            output = Path(scratch) / library.name
            command = [compiler, *_FLAGS, str(source), "-o", str(output), "-lm"]
            subprocess.run(command, capture_output=True, check=True, timeout=120)
            seal = Path(scratch) / "seal"
            seal.write_text(_digest(output))
            output.replace(library)
            seal.replace(library.with_suffix(".sha256"))
    return library


def _with_headers(source: Path) -> bytes:
    """The file and what it includes of ours."""
    text = source.read_bytes()
    headers = re.findall(rb'^#include "(.+)"', text, re.MULTILINE)
    return text + b"".join(_with_headers(source.parent / name.decode()) for name in headers)


def _is_whole(library: Path) -> bool:
    """Whether the file is what was compiled: loading a torn one would kill the process."""
    try:
        return library.with_suffix(".sha256").read_text() == _digest(library)
    except (OSError, ValueError):
        return False


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _processor() -> bytes:
    """What `-march=native` depends on."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line for line in lines if line.startswith(("flags", "Features"))).encode()
    except (OSError, StopIteration):
        return platform.processor().encode()
