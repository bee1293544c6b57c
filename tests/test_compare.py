"""Two files of one name: what differs first, and which figures can be compared at all."""

from pathlib import Path

import pytest

from msgdrop_cli.report.compare import difference, is_compared

OURS = b"\x89PNG Software\0Matplotlib version3.11.0, https://matplotlib.org/ "
THEIRS = OURS.replace(b"3.11.0", b"3.9.2")


def pair(folder: Path, name: str, made: bytes, there: bytes) -> tuple[Path, Path]:
    """The file made again, and the one that is there."""
    for place, content in (("made", made), ("there", there)):
        (folder / place).mkdir()
        (folder / place / name).write_bytes(content)
    return folder / "made" / name, folder / "there" / name


def test_the_first_line_that_differs_is_shown_around_its_first_letter(tmp_path: Path) -> None:
    """Long lines are cut on both sides."""
    made = b"same\n" + b"a" * 200 + b"1.25" + b"z" * 200 + b"\n"
    found = difference(*pair(tmp_path, "TABLES.md", made, made.replace(b"1.25", b"1.35")))
    assert found is not None
    assert (found.file, found.what) == (tmp_path / "there" / "TABLES.md", "line 2")
    assert found.expected.startswith("'\u2026aaaa")
    assert "a1.25zz" in found.expected
    assert "a1.35zz" in found.found
    assert len(found.expected) < 110


@pytest.mark.parametrize("there", [b"one\ntwo\n", b"one\ntwo\nthree", b"one\ntwo\nthree\n\n"])
def test_a_missing_or_added_line_is_a_difference(tmp_path: Path, there: bytes) -> None:
    """So is the end of the last line."""
    found = difference(*pair(tmp_path, "a.csv", b"one\ntwo\nthree\n", there))
    assert found is not None
    assert found.what in ("line 3", "line 4", "line 5")


@pytest.mark.parametrize(
    ("made", "there", "compared", "differs"),
    [
        (OURS + b"1", OURS + b"1", True, False),
        (OURS + b"1", OURS + b"2", True, True),
        (OURS + b"1", THEIRS + b"1", False, False),
        (OURS + b"1", b"\x89PNG 2", False, False),
        (b"\x89PNG 1", b"\x89PNG 2", False, False),
        (b"\x89PNG 1", b"\x89PNG 1", True, False),
    ],
)
def test_figures_are_compared_if_one_matplotlib_drew_them(
    tmp_path: Path, made: bytes, there: bytes, compared: bool, differs: bool
) -> None:
    """Another one, or one that the file does not name, may draw other bytes of the same."""
    files = pair(tmp_path, "a.png", made, there)
    assert is_compared(*files) is compared
    assert (difference(*files) is not None) is differs
