"""The site and the man pages: complete, without a dead link, and in the words of `--help`."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import typer

from docs import build, manual
from msgdrop_cli import app
from tests.cli_runs import ROOT, msgdrop
from tests.markdown import DOCS, Page

COMMANDS: dict[str, Any] = typer.main.get_command(app.app).commands  # type: ignore[attr-defined]
PAGES = manual.markdown_pages()
MAN = manual.man_pages()
TYPED = [
    pytest.param(line, id=f"{path.relative_to(ROOT)}: {line}")
    for path in (ROOT / "README.md", ROOT / "results" / "README.md", *sorted(DOCS.glob("*.md")))
    for line in Page(path.read_text()).commands()
]
PLACEHOLDERS = {"RUN": "results", "...": "x"}


def words(text: str) -> set[str]:
    """Letters and numbers, whatever stands between them."""
    return set(re.findall(r"\w+", text))


def help_of(name: str) -> str:
    """What `--help` says of a command, or of the program."""
    return msgdrop(*([] if name == manual.PROGRAM else [name]), "--help").out


@pytest.mark.parametrize("name", PAGES)
def test_a_page_says_what_help_says(name: str) -> None:
    """Every word of it, on the site and in the man page; no entry is cut short."""
    said = words(help_of(name)) - {"Usage"}
    assert said - words(PAGES[name]) == set()
    file = "msgdrop.1" if name == manual.PROGRAM else f"msgdrop-{name}.1"
    assert {word.lower() for word in said} - words(MAN[file].lower()) == set()


def test_there_is_a_page_for_every_command() -> None:
    """And one for the program."""
    assert list(PAGES) == [manual.PROGRAM, *COMMANDS]
    assert len(MAN) == len(PAGES)


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_are_lines_of_their_own(name: str) -> None:
    """In a block on the site, as they are typed."""
    examples = [line.strip() for line in help_of(name).splitlines() if "    msgdrop " in line]
    _, _, below = PAGES[name].partition("## Examples\n\n```\n")
    assert below.partition("\n```")[0].splitlines() == examples


@pytest.mark.skipif(shutil.which("groff") is None, reason="there is no groff here")
@pytest.mark.parametrize("name", MAN)
def test_a_man_page_is_set_without_a_warning(name: str) -> None:
    """With its sections, and no dash for a minus."""
    done = subprocess.run(
        ["groff", "-man", "-ww", "-Tascii", "-P-c"], input=MAN[name], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    for heading in ("NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXIT STATUS", "SEE ALSO"):
        assert re.search(rf"^.?\W*{heading}", re.sub(r".\x08", "", done.stdout), re.MULTILINE)
    assert "--help" in re.sub(r".\x08", "", done.stdout)


def test_a_line_that_looks_like_a_request_is_text() -> None:
    """To troff a dot or a quote in front is one."""
    formatter = manual.Roff()
    for text in (".so /etc/passwd", "'quoted'", r"a\b"):
        formatter.paragraph(text)
    assert formatter.parts == [
        ".PP\n\\&.so /etc/passwd\n",
        ".PP\n\\&'quoted'\n",
        ".PP\na\\eb\n",
    ]


def test_text_is_no_markup_on_the_site() -> None:
    """Angles and stars are shown."""
    formatter = manual.Markdown()
    formatter.paragraph("<b> & 2*3*4")
    assert formatter.parts == [r"&lt;b&gt; &amp; 2\*3\*4" + "\n\n"]


def test_every_page_is_in_the_menu() -> None:
    """All of `docs`; entries lead to files that are copied."""
    entries = [page for section in build.menu() for page in section.values()]
    places = {
        place
        for each in entries
        for place in (
            [each] if isinstance(each, str) else (p for page in each for p in page.values())
        )
    }
    assert {f"docs/{path.name}" for path in DOCS.glob("*.md")} <= places
    copied = {str(path.relative_to(ROOT)) for path in build.everything()}
    assert {place for place in places if not place.startswith("docs/commands/")} <= copied


def test_no_page_leads_nowhere(tmp_path: Path) -> None:
    """Pages, sources and pictures that are linked to are there; one that is not is named."""
    assert len(build.everything()) > 50
    page = tmp_path / "page.md"
    page.write_text("[gone](gone.md#here), [there](page.md), [away](https://example.org/x)\n")
    with pytest.raises(FileNotFoundError, match=r"page\.md: links to .*gone\.md"):
        build.linked(page)
    page.write_text("[there](page.md), `[code](code.md)`\n```\n[x](y.md)\n```\n")
    assert build.linked(page) == [page.resolve()]


@pytest.mark.parametrize("line", TYPED)
def test_every_command_on_the_pages_is_understood(line: str) -> None:
    """Its command, options and how they are spelt."""
    _, command, *arguments = shlex.split(line)
    if command.startswith("-"):
        pytest.skip("an option of the program itself")
    COMMANDS[command].make_context(command, [PLACEHOLDERS.get(a, a) for a in arguments])


def test_the_pages_have_commands() -> None:
    """The pattern above finds them."""
    assert len(TYPED) > 30
