"""PAPER.md names files and tests that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "PAPER.md").read_text()
NAMED = sorted(set(re.findall(r"`(test_\w+)`", PAGE)))
FILES = sorted(set(re.findall(r"`((?:msgdrop_cli|envs|ablations|tests)/[\w./-]+)`", PAGE)))


@pytest.mark.parametrize("file", FILES)
def test_every_file_named_exists(file: str) -> None:
    """A row that points nowhere is worse than none."""
    assert (ROOT / file).is_file()


@pytest.mark.parametrize("name", NAMED)
def test_every_test_named_exists(name: str) -> None:
    """Each statement is held by a test that is really there."""
    sources = "".join(path.read_text() for path in (ROOT / "tests").glob("test_*.py"))
    assert f"def {name}(" in sources


def test_the_page_names_something() -> None:
    """The patterns above still find what they look for."""
    assert len(NAMED) > 30
    assert len(FILES) > 10
