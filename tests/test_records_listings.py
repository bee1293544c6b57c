"""Listings of folders go on where a signal has interrupted them."""

import dataclasses
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.listings import listed
from msgdrop_cli.records.ours import delete_checkpoints
from msgdrop_cli.records.references import find_references, keep_references
from msgdrop_cli.records.temporary import remove_leftovers
from tests.test_references import KNOWN


@pytest.fixture
def _interrupted(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Every other call fails with EINTR."""
    scandir: Callable[..., Any] = os.scandir
    calls = list[None]()

    def scan(*arguments: Any) -> Any:
        calls.append(None)
        if len(calls) % 2:
            raise InterruptedError(4, "Interrupted system call")
        return scandir(*arguments)

    monkeypatch.setattr(os, "scandir", scan)
    yield
    assert calls


@pytest.mark.usefixtures("_interrupted")
def test_an_interrupted_listing_is_made_again(tmp_path: Path) -> None:
    """Sorted, hidden names too; a folder that is missing has nothing in it."""
    for name in ("b", "a", ".tmp-1"):
        (tmp_path / name).touch()
    assert [path.name for path in listed(tmp_path)] == [".tmp-1", "a", "b"]
    assert [path.name for path in listed(tmp_path, ".tmp-*")] == [".tmp-1"]
    assert listed(tmp_path / "missing") == listed(tmp_path / "a") == []


def test_a_folder_that_cannot_be_read_is_told_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where a run's checkpoints are to be; it is no bug, and not as if nothing were there."""

    def closed(path: Path) -> Any:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "scandir", closed)
    for look in (listed, delete_checkpoints, remove_leftovers):
        with pytest.raises(RecordError, match="cannot be read: Permission denied"):
            look(tmp_path)


@pytest.mark.usefixtures("_interrupted")
def test_references_are_found_by_interrupted_listings(tmp_path: Path) -> None:
    """They are not played again for that."""
    keep_references(tmp_path / "published" / "study", "some-game", dataclasses.asdict(KNOWN))
    assert find_references(tmp_path, "some-game") == KNOWN
