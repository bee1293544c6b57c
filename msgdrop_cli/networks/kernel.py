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

_FLAGS = ("-O3", "-march=native", "-std=c11", "-fno-math-errno", "-fPIC", "-shared")


def kernel_name() -> str:
    """What this process can compute with; what a run does compute with, its learner says."""
    return "torch" if _compiler() is None else "c"


@cache
def load(source: Path) -> ctypes.CDLL | None:
    """The compiled file, or None where there is no C compiler or it is not wanted."""
    compiler = _compiler()
    if compiler is None:
        return None
    try:
        return ctypes.CDLL(str(_built(compiler, source)))
    except (OSError, RuntimeError, subprocess.SubprocessError):  # RuntimeError: there is no home
        return None


def _compiler() -> str | None:
    if os.environ.get("MSGDROP_KERNEL") == "torch":
        return None
    return shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


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
