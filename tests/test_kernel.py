"""Building the C file: chosen or not, kept whole, and never in the way where it cannot be built."""

import shutil
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


def test_a_torn_library_is_built_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A truncated file in the cache is never loaded; it would kill the process."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert fresh(SOURCE) is not None
    [library] = (tmp_path / "msgdrop").glob("*.so")
    whole = library.read_bytes()
    library.unlink()  # another file: the one above is in use by this process
    library.write_bytes(whole[:2000])
    assert fresh(SOURCE) is not None
    assert library.read_bytes() == whole


def test_no_compiler_and_no_home_leave_the_torch_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing to compile with, or nowhere to keep it, is no error."""
    with monkeypatch.context() as patch:
        patch.setenv("PATH", "")
        assert fresh(SOURCE) is None
        assert why_torch() == "no C compiler: cc, gcc or clang"
    with monkeypatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", "/proc/nowhere")
        assert fresh(SOURCE) is None
        assert "sparse_rows.c cannot be kept or loaded: " in (why_torch() or "")


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
