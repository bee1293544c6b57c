"""What an error message proposes."""

import re
import tomllib

from msgdrop_cli.errors import nearest, to_install
from tests.cli_runs import ROOT
from tests.test_rooms import PRODUCT

PAGES = (ROOT / "README.md", *(ROOT / "docs").glob("*.md"))


def test_what_begins_as_typed_is_nearer_than_what_looks_alike() -> None:
    """`blockwise` means the question that begins so; a slip of the finger the one that is alike."""
    questions = ("architecture", "blockwise-vs-elementwise", "broken-links")
    assert nearest("blockwise", questions) == "did you mean 'blockwise-vs-elementwise'?"
    assert nearest("brokn-links", questions) == "did you mean 'broken-links'?"
    assert nearest("pursuit", ("pursuit-n8", "pursuit-n6")) == "did you mean 'pursuit-n6'?"
    assert nearest("x", questions).startswith("known: architecture, ")


def test_an_optional_part_is_installed_from_a_checkout() -> None:
    """No package index has msgdrop: neither code nor a page asks one for it."""
    for file in (*PRODUCT, *PAGES):
        assert not re.search(r"pip install [^\n]*msgdrop\[", file.read_text()), file


def test_each_optional_part_that_is_named_is_one() -> None:
    """By its name in pyproject.toml."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    text = "".join(file.read_text() for file in (*PRODUCT, *PAGES))
    pairs = re.findall(r"'\.\[([\w,]+)\]'|to_install\(['\"](\w+)", text)
    named = {each for pair in pairs for each in pair if each}
    assert {"pettingzoo", "video"} <= named <= {*project["optional-dependencies"]}
    assert to_install("dask").endswith("-e '.[dask]'")
