"""Building the C file: chosen or not, kept whole, and never in the way where it cannot be built."""

import hashlib
import os
import shutil
import time
from collections.abc import Iterator
from ctypes import CDLL
from pathlib import Path

import pytest

from msgdrop_cli.algorithms.compiled import SOURCE
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.networks import kernel
from msgdrop_cli.networks.kernel import load, why_torch

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")


@pytest.fixture(autouse=True)
def kernel_is_wanted(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Whatever the environment of the tests says; nothing is remembered."""
    monkeypatch.delenv("MSGDROP_KERNEL", raising=False)
    kernel._loaded.cache_clear()
    yield
    kernel._loaded.cache_clear()


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A source that is quick to build."""
    source = tmp_path / "source" / "small.c"
    source.parent.mkdir()
    source.write_text("int given(void) { return 1; }\n")
    return source


def fresh(source: Path) -> CDLL | None:
    """The library as a new process would load it."""
    kernel._loaded.cache_clear()
    return load(source)


def test_the_torch_path_can_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    """MSGDROP_KERNEL=torch loads nothing, and says so; any other word is refused."""
    assert fresh(SOURCE) is not None
    assert why_torch() is None
    monkeypatch.setenv("MSGDROP_KERNEL", "torch")
    assert fresh(SOURCE) is None
    assert why_torch() == "MSGDROP_KERNEL=torch"
    monkeypatch.setenv("MSGDROP_KERNEL", "Torch")
    with pytest.raises(DefinitionError, match="must be torch or not set, not 'Torch'"):
        fresh(SOURCE)


def test_a_torn_library_is_built_again(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A truncated file in the cache is never loaded; it would kill the process."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert fresh(small) is not None
    [library] = (tmp_path / "msgdrop").glob("*.so")
    whole = library.read_bytes()
    library.unlink()  # another file: the one above is in use by this process
    library.write_bytes(whole[:-2000])
    assert fresh(small) is not None
    assert library.read_bytes() == whole


def test_no_compiler_leaves_the_torch_path(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing to compile with is no error."""
    monkeypatch.setenv("PATH", "")
    assert fresh(small) is None
    assert why_torch() == "no C compiler: cc, gcc or clang"


def test_a_compiler_that_hangs_is_given_up(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Asked for its version it says nothing, and its child holds what it was given to write to."""
    (tmp_path / "cc").write_text("#!/bin/sh\n/bin/sleep 60\n")
    (tmp_path / "cc").chmod(0o700)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(kernel, "_ANSWERS_WITHIN_S", 0.2)
    began = time.monotonic()
    assert fresh(small) is None
    assert time.monotonic() - began < 10.0
    assert "cc does not answer within" in (why_torch() or "")


def _plant(small: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A library and its seal where ours would lie, made by somebody else: they are never read."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder.with_name("honest")))
    assert fresh(small) is not None
    [honest] = folder.with_name("honest").glob("msgdrop/*.so")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    (folder / "msgdrop").mkdir(parents=True)
    library, content = folder / "msgdrop" / honest.name, b"somebody else's code"
    library.write_bytes(content)
    library.with_suffix(".sha256").write_text(hashlib.sha256(content).hexdigest())
    return library


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702], ids=oct)
def test_a_folder_open_to_others_is_not_used(
    mode: int, small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither what lies in it is loaded, nor is anything put there."""
    library = _plant(small, tmp_path / "cache", monkeypatch)
    library.parent.chmod(mode)
    before = {path: path.read_bytes() for path in library.parent.iterdir()}
    assert fresh(small) is not None
    assert {path: path.read_bytes() for path in library.parent.iterdir()} == before


def test_a_folder_of_somebody_else_is_not_used(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who made a folder can put into it what he likes, whatever its mode."""
    library = _plant(small, tmp_path / "cache", monkeypatch)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    before = library.read_bytes()
    assert kernel._kept_folder() != library.parent
    assert library.read_bytes() == before


@pytest.mark.parametrize("part", [".so", ".sha256"])
def test_a_file_open_to_others_is_built_again(
    part: str, small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library and its seal alike: together they would vouch for anything."""
    library = _plant(small, tmp_path / "cache", monkeypatch)
    library.with_suffix(part).chmod(0o666)
    assert fresh(small) is not None
    assert library.stat().st_mode & 0o077 == 0
    assert library.read_bytes()[:4] == b"\x7fELF"


def test_a_link_is_no_library(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it points to may change after it was looked at."""
    library = _plant(small, tmp_path / "cache", monkeypatch)
    library.rename(tmp_path / "elsewhere")
    library.symlink_to(tmp_path / "elsewhere")
    assert fresh(small) is not None
    assert not library.is_symlink()
    assert (tmp_path / "elsewhere").read_bytes() == b"somebody else's code"


@pytest.mark.parametrize("said", ["/proc/nowhere", "relative/cache", ""])
def test_where_nothing_can_be_kept_it_is_built_each_time(
    said: str, small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No home, or a relative XDG_CACHE_HOME, which is to be ignored: nothing is left here."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", said)
    monkeypatch.setenv("HOME", "/proc/nowhere")
    assert fresh(small) is not None
    assert [path.name for path in tmp_path.iterdir()] == ["source"]


def test_another_header_is_another_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a file includes of ours is a part of it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "a.c").write_text('#include "a.h"\nint given(void) { return GIVEN; }\n')
    found = []
    for number in (1, 2):
        (tmp_path / "a.h").write_text(f"enum {{ GIVEN = {number} }};\n")
        library = fresh(tmp_path / "a.c")
        assert library is not None
        found.append(library.given())
    assert found == [1, 2]
