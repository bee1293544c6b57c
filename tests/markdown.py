"""Reads the pages of the documentation: their sections, tables and blocks of code."""

import re
from typing import NamedTuple

from tests.cli_runs import ROOT

DOCS = ROOT / "docs"
_CELLS = re.compile(r"(?<!\\)\|")


class Page(NamedTuple):
    """One page, as Markdown."""

    text: str

    def section(self, heading: str) -> "Page":
        """What stands below a heading of the second level, up to the next one."""
        _, found, below = self.text.partition(f"\n## {heading}\n")
        assert found, f"there is no section {heading!r}"
        return Page(below.partition("\n## ")[0])

    def rows(self) -> list[list[str]]:
        """The cells of every row of its tables, without their heads."""
        rows = [
            [cell.strip() for cell in _CELLS.split(line)[1:-1]]
            for line in self.text.splitlines()
            if line.startswith("|")
        ]
        rules = [n for n, row in enumerate(rows) if set("".join(row)) <= set("-: ")]
        heads = {n for rule in rules for n in (rule - 1, rule)}
        return [row for n, row in enumerate(rows) if n not in heads]

    def keys(self) -> set[str]:
        """What stands as code in the first cells of its tables."""
        return {name for row in self.rows() for name in named(row[0])}

    def code(self, language: str) -> list[str]:
        """Its blocks of code in a language."""
        blocks = re.findall(r"^ *```(\w*)\n(.*?)^ *```$", self.text, re.DOTALL | re.MULTILINE)
        return [block for name, block in blocks if name == language]

    def commands(self) -> list[str]:
        """The lines of its blocks of commands, without what is said about them."""
        lines = [line for block in self.code("") for line in block.splitlines()]
        return [line.partition("  #")[0].strip() for line in lines if line.startswith("msgdrop ")]


def named(cell: str) -> list[str]:
    """What stands as code in a piece of text."""
    return re.findall(r"`([^`]+)`", cell)


def page(name: str) -> Page:
    """A page of the folder `docs`."""
    return Page((DOCS / name).read_text())
