"""Builds `sparse.c` with the machine's C compiler, once, and loads it; without one: None.

The compiled file lies in the user's cache folder under a name made of the source, the flags, the
compiler and the processor, so it is never used where it does not belong. `MSGDROP_KERNEL=torch`
chooses the plain torch path, which gives the same numbers up to rounding (test_kernel).
"""

import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

_SOURCE = Path(__file__).with_name("sparse.c")
_FLAGS = ("-O3", "-march=native", "-std=c11", "-fPIC", "-shared")


class Shape(ctypes.Structure):
    """The sizes and strides that both functions of `sparse.c` take first."""

    _fields_ = tuple(
        (name, ctypes.c_int64)
        for name in (
            *("networks", "rows", "blocks", "units", "factors", "outputs"),
            *("x_network", "x_row", "f_network", "f_row"),
        )
    )


@cache
def kernel() -> ctypes.CDLL | None:
    """The functions of `sparse.c`, or None where there is no C compiler or it is not wanted."""
    library = load(_SOURCE)
    if library is None:
        return None
    for function, pointers in (("first_layer", 5), ("first_layer_backward", 4)):
        getattr(library, function).argtypes = (
            ctypes.POINTER(Shape),
            *(ctypes.c_void_p for _ in range(pointers)),
        )
        getattr(library, function).restype = None
    return library


def load(source: Path) -> ctypes.CDLL | None:
    """The compiled file, or None where there is no C compiler or it is not wanted."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None or os.environ.get("MSGDROP_KERNEL") == "torch":
        return None
    try:
        return ctypes.CDLL(str(_built(compiler, source)))
    except (OSError, RuntimeError, subprocess.SubprocessError):  # RuntimeError: there is no home
        return None


def kernel_name() -> str:
    """What a record says about the arithmetic: runs are bit-equal only with the same one."""
    return "torch" if kernel() is None else "c-sparse"


def _built(compiler: str, source: Path) -> Path:
    version = subprocess.run([compiler, "--version"], capture_output=True, check=True).stdout
    recipe = b"\0".join((source.read_bytes(), " ".join(_FLAGS).encode(), version, _processor()))
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "msgdrop"
    library = folder / f"{source.stem}-{hashlib.sha256(recipe).hexdigest()[:16]}.so"
    if not _is_whole(library):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            output = Path(scratch) / library.name
            command = [compiler, *_FLAGS, str(source), "-o", str(output)]
            subprocess.run(command, capture_output=True, check=True, timeout=120)
            seal = Path(scratch) / "seal"
            seal.write_text(_digest(output))
            output.replace(library)
            seal.replace(library.with_suffix(".sha256"))
    return library


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
