"""Archives are told by their numbers: none is written over, whatever has been taken away."""

from pathlib import Path

import pytest

from msgdrop_cli.records import archive
from msgdrop_cli.records.archive import contents, pack
from tests.test_archive import trained


def test_an_archive_that_was_taken_away_is_never_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full one stays; what was in the one that is gone goes into a new one, once."""
    monkeypatch.setattr(archive, "MOST_RUNS", 2)
    records = [trained(tmp_path / "there", "dcc", seed) for seed in range(1, 7)]
    first, second, third = pack(records, tmp_path, "q")
    kept = {path: contents(path) for path in (second, third)}
    gone = contents(first)
    first.unlink()
    pack(records, tmp_path, "q")
    assert pack(records, tmp_path, "q") == []
    assert {path: contents(path) for path in (second, third)} == kept
    assert contents(tmp_path / "q-04.zip") == gone


def test_a_hundredth_archive_comes_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By its number, not by its name."""
    monkeypatch.setattr(archive, "MOST_RUNS", 1)
    records = [trained(tmp_path / "there", "dcc", seed) for seed in (1, 2, 3)]
    [first] = pack(records[:1], tmp_path, "q")
    first.rename(tmp_path / "q-99.zip")
    assert [path.name for path in pack(records[:2], tmp_path, "q")] == ["q-99.zip", "q-100.zip"]
    assert [path.name for path in pack(records, tmp_path, "q")] == ["q-100.zip", "q-101.zip"]
