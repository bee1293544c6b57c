"""Pages that people read and the program, too: at the top of a checkout, or carried by a wheel."""

from collections.abc import Iterator
from importlib import resources
from pathlib import Path

import msgdrop_cli

METRICS = "docs/metrics.md"
VERDICTS = "docs/verdicts.md"
PAPER = "PAPER.md"


def page(name: str) -> str:
    """What a page says; nothing if the program came without it."""
    for file in (Path(__file__).parents[2] / name, resources.files(msgdrop_cli) / name):
        if file.is_file():
            return file.read_text("utf-8")
    return ""


def rows(text: str) -> Iterator[list[str]]:
    """The cells of every row of a page's tables, heads left out."""
    lines = [line.strip() for line in text.splitlines()]
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        is_head = set(line) <= set("|- ") or (below and set(below) <= set("|- "))
        if line.startswith("|") and not is_head:
            yield [cell.strip() for cell in line.strip("|").split("|")]
