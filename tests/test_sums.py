"""The list of a folder's files: what is in it, and what stands in its way."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.sums import SUMS, differences, list_sums, sums_of


def test_the_list_names_every_file_but_itself(tmp_path: Path) -> None:
    """In whatever folder it lies, sorted, with its SHA-256."""
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "x y").write_bytes(b"abc")
    (tmp_path / "a").write_bytes(b"")
    list_sums(tmp_path)
    list_sums(tmp_path)  # once more, with the list there
    assert (tmp_path / SUMS).read_text() == (
        "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855  a\n"
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  b/x y\n"
    )
    assert [*sums_of(tmp_path)] == ["a", "b/x y"]
    assert [*differences(tmp_path)] == []


@pytest.mark.parametrize("name", ["new\nline", "back\\slash"])
def test_a_name_that_the_list_cannot_hold_is_refused(tmp_path: Path, name: str) -> None:
    """It would have to be escaped, and no file of ours is called like that."""
    (tmp_path / name).touch()
    with pytest.raises(RecordError, match="remove it"):
        list_sums(tmp_path)


def test_a_link_is_no_file(tmp_path: Path) -> None:
    """Neither to a file nor to a folder: what it leads to may change any time."""
    (tmp_path / "published").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "published" / "link").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(RecordError, match="link"):
        list_sums(tmp_path / "published")


@pytest.mark.parametrize(
    "other",
    [
        lambda text: text.upper(),
        lambda text: text.removesuffix("\n"),
        lambda text: text + text,
        lambda text: text.replace("  ", " *"),
        lambda text: "",
    ],
    ids=["capitals", "no end", "twice", "binary", "empty"],
)
def test_only_the_list_itself_is_the_list(tmp_path: Path, other: Callable[[str], str]) -> None:
    """Whatever says the same in another form is a change, too."""
    (tmp_path / "a").touch()
    text = list_sums(tmp_path).read_text()
    (tmp_path / SUMS).write_text(other(text))
    with suppress(RecordError):  # a list that cannot be read is found as well
        assert [*differences(tmp_path)] != []
