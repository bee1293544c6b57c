"""Writes the marked blocks of the repository's pages anew; see the package."""

import re
from collections.abc import Callable
from pathlib import Path

from benchmarks.readme import judged, navigation, pursuit, rates, waterworld
from msgdrop_cli.records.files import write_bytes_atomic

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", ROOT / "results" / "README.md")
BLOCKS: dict[str, Callable[[], str]] = {
    name: block
    for said in (pursuit, rates, judged, navigation, waterworld)
    for name, block in said.BLOCKS.items()
}
"""What writes each block, by the name in its marker."""
MARKED = re.compile(r"(?<=<!-- records: )([a-z0-9-]+)( -->\n)(.*?)(?=<!-- end -->)", re.DOTALL)


def filled(page: str) -> str:
    """The page with every marked block as the records give it.

    Raises KeyError for a block that nothing writes, ValueError where a sentence no longer holds.
    """
    return MARKED.sub(lambda block: f"{block[1]}{block[2]}{BLOCKS[block[1]]()}\n", page)


def main() -> None:
    """Write both pages, and say which of them changed."""
    for page in PAGES:
        before = page.read_text()
        after = filled(before)
        if after != before:
            write_bytes_atomic(page, after.encode())
            print(page.relative_to(ROOT))


if __name__ == "__main__":
    main()
