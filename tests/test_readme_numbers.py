"""The pages say what the records say: every number of a study stands in a block made of them."""

import re
from pathlib import Path

import pytest

from benchmarks.readme.__main__ import BLOCKS, MARKED, PAGES, PLAYED, filled
from benchmarks.readme.studies import Estimate, expect, listing, paragraph, table
from msgdrop_cli.analysis.statistics import Interval

ESTIMATE = re.compile(r"-?\d[\d.]* \[-?\d[\d.]*,\s")
"""A number with its interval."""
CELL = re.compile(r"\| -?\d[\d,]*\.\d+ (?=\|)")
"""A cell of a table that is a measured number and nothing else."""
VERDICT = re.compile(r"\*\*(supported|contradicted|level|undecided)\*\*")
BY_HAND = re.compile(r"<!-- played: ([a-z-]+) -->\n(.*?)<!-- end -->\n", re.DOTALL)
"""What is told of records, but needs policies played again."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: f"{page.parent.name}/{page.name}")
def test_prose_and_records_agree(page: Path) -> None:
    """If this fails: `make readme`, and read what it wrote."""
    text = page.read_text()
    assert filled(text) == text


def test_every_block_stands_on_one_page() -> None:
    """None is forgotten, and no marker is mistyped."""
    text = "".join(page.read_text() for page in PAGES)
    assert sorted(block[1] for block in MARKED.finditer(text)) == sorted(BLOCKS)
    assert text.count("<!-- records:") == len(BLOCKS)
    assert text.count("<!-- played:") == len(PLAYED)
    assert text.count("<!-- end -->") == len(BLOCKS) + len(PLAYED)


def test_what_is_played_says_how() -> None:
    """The few exceptions, each beside the command or the test that gives its numbers."""
    found = {block[1]: page for page in PAGES for block in BY_HAND.finditer(page.read_text())}
    assert found.keys() == PLAYED.keys()
    assert len(PLAYED) <= 3
    for name, page in found.items():
        assert PLAYED[name] in page.read_text()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: f"{page.parent.name}/{page.name}")
def test_no_number_of_a_record_is_typed(page: Path) -> None:
    """Outside of the blocks there is no interval, no table of measured numbers and no verdict."""
    typed = BY_HAND.sub("", MARKED.sub("", page.read_text()))
    assert [each[0] for rule in (ESTIMATE, CELL, VERDICT) for each in rule.finditer(typed)] == []


@pytest.mark.parametrize("rule", [ESTIMATE, CELL, VERDICT], ids=["interval", "cell", "verdict"])
def test_the_blocks_have_what_may_not_be_typed(rule: re.Pattern[str]) -> None:
    """So the rules know these numbers and words where they see them."""
    blocks = [block[3] for page in PAGES for block in MARKED.finditer(page.read_text())]
    assert any(rule.search(block) for block in blocks)


def test_a_changed_number_and_a_changed_word_are_put_right() -> None:
    """In a table and in a sentence; what stands outside of the blocks is left alone."""
    text = PAGES[0].read_text()
    other = text.replace("| 27.1 [26.0, 28.3] |", "| 27.2 |").replace("eight comparisons", "nine")
    assert other != text
    assert filled(other) == text
    assert filled("typed 1.0\n") == "typed 1.0\n"


def test_a_block_that_nothing_writes_is_an_error() -> None:
    """It would stay as it was typed."""
    with pytest.raises(KeyError, match="unknown"):
        filled("<!-- records: unknown -->\n1.0\n<!-- end -->")


def test_a_sentence_that_no_longer_holds_is_not_written() -> None:
    """The numbers would be right, and the words wrong."""
    with pytest.raises(ValueError, match="FDC is first; write that text anew"):
        expect(False, "FDC is first")


def test_numbers_are_as_long_as_their_size_deserves() -> None:
    """One decimal below 100, none from there on, and no minus before a zero."""
    assert Estimate(9.96, Interval(-0.04, 12.0)).text() == "10.0 [0.0, 12.0]"
    assert Estimate(-99.4, Interval(-100.4, -97.2)).text() == "-99 [-100, -97]"
    assert Estimate(4.949, Interval(2.444, 7.372)).text(2) == "4.95 [2.44, 7.37]"
    assert Estimate(1.0, None).text() == "1.0"


def test_an_interval_is_never_broken() -> None:
    """Nor parted from its number."""
    text = paragraph(f"{'word ' * 18} 0.5 [-0.2, 0.8] more")
    assert text.splitlines()[1] == "0.5 [-0.2, 0.8] more"
    assert max(map(len, text.splitlines())) <= 100


def test_tables_and_lists_are_markdown() -> None:
    """As the pages have them."""
    assert table(("a", "b"), [("1", "")]) == "| a | b |\n|---|---|\n| 1 |  |"
    assert [listing(["a"]), listing(["a", "b", "c"])] == ["a", "a, b and c"]
