"""Puts together what `make docs` shows: the pages, what they link to, and the commands' pages.

The copies stand in `build/docs` as the originals do in the repository, so no link is changed, and
one that leads nowhere is an error. What stands where in the menu says `docs/README.md`.

python -m docs.build
"""

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docs.manual import PROGRAM, markdown_pages

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build"
_HOME, _COMMANDS = "docs/README.md", "docs/commands"
_LINK = re.compile(r"\]\(([^)\s#:]+)(?:#[^)]*)?\)")
"""A link to a file of ours."""
_ENTRY = re.compile(r"^\* \[([^]]+)\]\(([^)]+)\)", re.MULTILINE)
_STYLE = """/* Wide tables scroll by themselves, so that a page fits on a telephone. */
.rst-content table.docutils { display: block; overflow-x: auto; width: auto; }
.rst-content table.docutils td { white-space: normal; }
.rst-content .section .docutils { margin: 0 0 24px; }
"""


def linked(page: Path) -> list[Path]:
    """The files of ours that a page links to or shows; FileNotFoundError for one that is not."""
    text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(), flags=re.DOTALL)
    found = [(page.parent / target).resolve() for target in _LINK.findall(text)]
    for file in found:
        if not file.exists():
            raise FileNotFoundError(f"{page}: links to {file}, which is not there")
    return found


def everything() -> set[Path]:
    """The pages of the menu, what they link to, and so on; folders that are linked to are none."""
    found: set[Path] = set()
    waiting = [ROOT / _HOME]
    while waiting:
        file = waiting.pop()
        if file not in found and file.is_file():
            found.add(file)
            waiting += linked(file) if file.suffix == ".md" else []
    return found


def menu() -> list[dict[str, Any]]:
    """The site's menu: the sections of the first page, then the commands."""
    _, *sections = (ROOT / _HOME).read_text().split("\n## ")
    entries: list[dict[str, Any]] = [{"Documentation": _HOME}]
    for section in sections:
        title, _, text = section.partition("\n")
        pages = [{name: _place(target)} for name, target in _ENTRY.findall(text)]
        entries.append({title: pages})
    commands = [{name: f"{_COMMANDS}/{name}.md"} for name in markdown_pages()]
    return [*entries, {"Commands": commands}]


def config() -> dict[str, Any]:
    """What mkdocs reads: every link is checked, and nothing is fetched from anywhere."""
    return {
        "site_name": PROGRAM,
        "docs_dir": "docs",
        "site_dir": "site",
        "use_directory_urls": False,
        "theme": {"name": "readthedocs", "highlightjs": False},
        "extra_css": ["style.css"],
        "plugins": ["search"],
        "markdown_extensions": ["sane_lists"],  # beside toc, tables and fenced_code
        "validation": {
            "nav": {"omitted_files": "ignore", "not_found": "warn"},
            "links": {"not_found": "warn", "anchors": "warn", "unrecognized_links": "warn"},
        },
        "nav": menu(),
    }


def _place(target: str) -> str:
    """Where a page stands that the first page links to."""
    return str((ROOT / _HOME).parent.joinpath(target).resolve().relative_to(ROOT))


def _files() -> Iterator[tuple[Path, str]]:
    """What is made here, with its place."""
    yield Path("docs/style.css"), _STYLE
    yield Path("mkdocs.yml"), json.dumps(config(), indent=2)  # which is YAML, too
    for name, text in markdown_pages().items():
        yield Path("docs", _COMMANDS, f"{name}.md"), text


def main() -> None:
    """Write `build/docs` and `build/mkdocs.yml` anew."""
    shutil.rmtree(BUILD / "docs", ignore_errors=True)
    for file in everything():
        copy = BUILD / "docs" / file.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, copy)
    for place, text in _files():
        (BUILD / place).parent.mkdir(parents=True, exist_ok=True)
        (BUILD / place).write_text(text)


if __name__ == "__main__":
    main()
