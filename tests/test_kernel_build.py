"""Building the C files: chosen or not, kept whole, never in the way where they cannot be."""

import hashlib
import os
import shutil
import time
from collections.abc import Iterator
from ctypes import CDLL
from pathlib import Path

import pytest

from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.kernels import build
from msgdrop_cli.kernels.build import library, why_torch

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")


@pytest.fixture(autouse=True)
def kernel_is_wanted(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Whatever the environment of the tests says; nothing is remembered."""
    monkeypatch.delenv("MSGDROP_KERNEL", raising=False)
    build._loaded.cache_clear()
    yield
    build._loaded.cache_clear()


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of C files that is quick to build, instead of the kernels' own."""
    folder = tmp_path / "source"
    folder.mkdir()
    (folder / "small.c").write_text('#include "small.h"\nint given(void) { return GIVEN; }\n')
    (folder / "small.h").write_text("enum { GIVEN = 1 };\n")
    monkeypatch.setattr(build, "_ROOM", folder)
    monkeypatch.setattr(build, "check_structs", lambda library: None)
    return folder


def fresh() -> CDLL | None:
    """The library as a new process would load it."""
    build._loaded.cache_clear()
    return library()


def test_the_torch_path_can_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    """MSGDROP_KERNEL=torch loads nothing, and says so; any other word is refused."""
    assert fresh() is not None
    assert why_torch() is None
    monkeypatch.setenv("MSGDROP_KERNEL", "torch")
    assert fresh() is None
    assert why_torch() == "MSGDROP_KERNEL=torch"
    monkeypatch.setenv("MSGDROP_KERNEL", "Torch")
    with pytest.raises(DefinitionError, match="must be torch or not set, not 'Torch'"):
        fresh()


@pytest.mark.usefixtures("small")
def test_a_torn_library_is_built_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A truncated file in the cache is never loaded; it would kill the process."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert fresh() is not None
    [library] = (tmp_path / "msgdrop").glob("*.so")
    whole = library.read_bytes()
    library.unlink()  # another file: the one above is in use by this process
    library.write_bytes(whole[:-2000])
    assert fresh() is not None
    assert library.read_bytes() == whole


@pytest.mark.usefixtures("small")
def test_a_processor_that_does_not_fuse_is_torchs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each product would be a call there, and torch's path takes a tenth of the time."""
    monkeypatch.setattr(build, "_processor", lambda: b"flags\t\t: fpu sse sse2 avx")
    assert fresh() is None
    assert why_torch() == "this processor has no fused multiply-adds"
    monkeypatch.setattr(build, "_processor", lambda: b"Features\t: fp asimd")
    assert fresh() is not None


@pytest.mark.usefixtures("small")
def test_no_compiler_leaves_the_torch_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing to compile with is no error."""
    monkeypatch.setenv("PATH", "")
    assert fresh() is None
    assert why_torch() == "no C compiler: cc, gcc or clang"


@pytest.mark.usefixtures("small")
def test_a_compiler_that_hangs_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked for its version it says nothing, and its child holds what it was given to write to."""
    (tmp_path / "cc").write_text("#!/bin/sh\n/bin/sleep 60\n")
    (tmp_path / "cc").chmod(0o700)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(build, "_ANSWERS_WITHIN_S", 0.2)
    began = time.monotonic()
    assert fresh() is None
    assert time.monotonic() - began < 10.0
    assert "cc does not answer within" in (why_torch() or "")


def _plant(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A library and its seal where ours would lie, made by somebody else: they are never read."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder.with_name("honest")))
    assert fresh() is not None
    [honest] = folder.with_name("honest").glob("msgdrop/*.so")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    (folder / "msgdrop").mkdir(parents=True)
    library, content = folder / "msgdrop" / honest.name, b"somebody else's code"
    library.write_bytes(content)
    library.with_suffix(".sha256").write_text(hashlib.sha256(content).hexdigest())
    return library


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702], ids=oct)
def test_a_folder_open_to_others_is_not_used(
    mode: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither what lies in it is loaded, nor is anything put there."""
    library = _plant(tmp_path / "cache", monkeypatch)
    library.parent.chmod(mode)
    before = {path: path.read_bytes() for path in library.parent.iterdir()}
    assert fresh() is not None
    assert {path: path.read_bytes() for path in library.parent.iterdir()} == before


@pytest.mark.usefixtures("small")
def test_a_folder_of_somebody_else_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who made a folder can put into it what he likes, whatever its mode."""
    library = _plant(tmp_path / "cache", monkeypatch)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    before = library.read_bytes()
    assert build.kept_folder() != library.parent
    assert library.read_bytes() == before


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("part", [".so", ".sha256"])
def test_a_file_open_to_others_is_built_again(
    part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library and its seal alike: together they would vouch for anything."""
    library = _plant(tmp_path / "cache", monkeypatch)
    library.with_suffix(part).chmod(0o666)
    assert fresh() is not None
    assert library.stat().st_mode & 0o077 == 0
    assert library.read_bytes()[:4] == b"\x7fELF"


@pytest.mark.usefixtures("small")
def test_a_link_is_no_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it points to may change after it was looked at."""
    library = _plant(tmp_path / "cache", monkeypatch)
    library.rename(tmp_path / "elsewhere")
    library.symlink_to(tmp_path / "elsewhere")
    assert fresh() is not None
    assert not library.is_symlink()
    assert (tmp_path / "elsewhere").read_bytes() == b"somebody else's code"


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("said", ["/proc/nowhere", "relative/cache", ""])
def test_where_nothing_can_be_kept_it_is_built_each_time(
    said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No home, or a relative XDG_CACHE_HOME, which is to be ignored: nothing is left here."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", said)
    monkeypatch.setenv("HOME", "/proc/nowhere")
    assert fresh() is not None
    assert [path.name for path in tmp_path.iterdir()] == ["source"]


def test_another_header_is_another_library(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the C files include of ours is a part of the library's name."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    found = []
    for number in (1, 2):
        (small / "small.h").write_text(f"enum {{ GIVEN = {number} }};\n")
        made = fresh()
        assert made is not None
        found.append(made.given())
    assert found == [1, 2]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("gamma, huber", "huber, gamma", "Rule.gamma"),
        ("int64_t agents, obs_blocks", "int64_t obs_blocks, agents", "Memory.agents"),
        ("} Net;", "    int64_t more;\n} Net;", "Net "),
        ("float step_size, root", "int64_t more; float step_size, root", "Adam "),
    ],
)
def test_a_struct_that_python_does_not_mirror_is_noticed(
    old: str, new: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A field that stands elsewhere in C would be wrong memory without a word."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    shutil.copytree(build._ROOM, tmp_path / "changed")
    changed = 0
    for header in ("dcc.h", "layers.h"):
        text = (tmp_path / "changed" / header).read_text()
        (tmp_path / "changed" / header).write_text(text.replace(old, new, 1))
        changed += old in text
    assert changed == 1
    monkeypatch.setattr(build, "_ROOM", tmp_path / "changed")
    monkeypatch.setattr(build, "_FLAGS", ("-O0", *build._FLAGS[1:]))  # quick to build
    with pytest.raises(RuntimeError, match=f"dcc_fields: {said}"):
        fresh()
