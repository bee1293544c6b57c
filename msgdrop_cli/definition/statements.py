"""PAPER.md as rows: what the paper says, how it is read here, and what follows if that is wrong.

The page is written for people and is the only register there is, so it is read instead of being
written down a second time. It stands at the top of a checkout; a wheel carries it.
"""

import re
from dataclasses import dataclass

from msgdrop_cli.definition.pages import PAPER, page

_CELL = re.compile(r"(?<!\\)\|")
_READING = re.compile(r"readings? ((?:`[\w-]+`(?:, )?)+)")
_COLUMNS, _CLAIM_COLUMNS = 5, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """A row of PAPER.md."""

    chapter: str
    says: str
    """What the paper says, with its lines; `nothing on ...` for what it leaves open."""
    read_as: str
    code: str
    tests: str
    if_wrong: str
    readings: tuple[str, ...]
    """The registered readings that read it otherwise."""

    @property
    def is_ours(self) -> bool:
        """Whether the reading adds to the paper: a choice of ours, or one among several."""
        return self.says.startswith("nothing on") or "ours" in self.read_as or bool(self.readings)


@dataclass(frozen=True, slots=True, kw_only=True)
class Register:
    """The whole page."""

    statements: tuple[Statement, ...]
    unclaimed: tuple[tuple[str, str], ...]
    """What the paper says that no claim stands for, and why."""


def read_register() -> Register:
    """PAPER.md of this program; an empty register if it came without."""
    return parse_register(page(PAPER))


def parse_register(text: str) -> Register:
    """The rows of the page's tables."""
    chapter, statements, unclaimed = "", [], []
    for line in text.splitlines():
        if line.startswith("## "):
            chapter = line.removeprefix("## ")
        cells = [cell.strip().replace("\\|", "|") for cell in _CELL.split(line)[1:-1]]
        if not cells or set(cells[0]) <= {"-"} or cells[0] == "the paper says (line)":
            continue
        if len(cells) == _COLUMNS:
            named = _READING.search(cells[1])
            readings = tuple(re.findall(r"`([\w-]+)`", named[1])) if named else ()
            statements.append(
                Statement(
                    chapter=chapter,
                    says=cells[0],
                    read_as=cells[1],
                    code=cells[2],
                    tests=cells[3],
                    if_wrong=cells[4],
                    readings=readings,
                )
            )
        elif len(cells) == _CLAIM_COLUMNS and "no claim" in cells[1]:
            unclaimed.append((cells[0], cells[1]))
    return Register(statements=tuple(statements), unclaimed=tuple(unclaimed))
