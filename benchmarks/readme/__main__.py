"""Writes the marked blocks of the repository's pages anew; see the package."""

import re
from collections.abc import Callable
from pathlib import Path

from benchmarks.readme import (
    eight,
    helps,
    judged,
    navigation,
    network,
    own,
    pursuit,
    rates,
    readings,
    waterworld,
)
from msgdrop_cli.records.files import write_bytes_atomic

ROOT = Path(__file__).parents[2]
PAGES = (
    *(ROOT / "README.md", ROOT / "results" / "README.md", ROOT / "PAPER.md"),
    *sorted((ROOT / "docs").glob("*.md")),
)
BLOCKS: dict[str, Callable[[], str]] = {
    name: block
    for said in (
        pursuit,
        eight,
        rates,
        own,
        network,
        judged,
        navigation,
        readings,
        waterworld,
        helps,
    )
    for name, block in said.BLOCKS.items()
}
"""What writes each block, by the name in its marker."""
PLAYED = {
    "message-scale": "msgdrop eval results/published/broken-links-two-million",
    "pettingzoo-trials": "--profile quick",
    "simple-policies": "test_what_simple_policies_get",
}
"""What no published record gives, by the name in its marker `<!-- played: ... -->`: the command or
the test that gives it, which stands beside it on the page."""
MARKED = re.compile(r"(?<=<!-- records: )([a-z0-9-]+)( -->\n?)(.*?)(?=<!-- end -->)", re.DOTALL)


def filled(page: str) -> str:
    """The page with every marked block as the records give it, in lines of its own or within one.

    Raises KeyError for a block that nothing writes, ValueError where a sentence no longer holds.
    """

    def block(found: re.Match[str]) -> str:
        end = "\n" if found[2].endswith("\n") else ""
        return f"{found[1]}{found[2]}{BLOCKS[found[1]]()}{end}"

    return MARKED.sub(block, page)


def main() -> None:
    """Write the pages, and say which of them changed."""
    for page in PAGES:
        before = page.read_text()
        after = filled(before)
        if after != before:
            write_bytes_atomic(page, after.encode())
            print(page.relative_to(ROOT))


if __name__ == "__main__":
    main()
