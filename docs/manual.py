"""The manual: every command's help as a page in Markdown and as a man page, by Typer itself.

Typer writes a help with a formatter; the two here write the same words in other marks. So nothing
stands here that `--help` does not say, and nothing can be out of date.

python -m docs.manual FOLDER   writes the man pages
"""

import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from html import escape
from pathlib import Path
from typing import Any

import typer

from msgdrop_cli import __version__
from msgdrop_cli.app import app

PROGRAM = "msgdrop"
_CODES = Path(__file__).with_name("exit-codes.md")
_KEPT = "\b\n"
"""What typer's texts begin with whose lines are to be left as they are."""


class Formatter(ABC):
    """What typer calls to write a help; the marks are a subclass's."""

    width = 1_000
    """Columns: nothing is cut short for want of room."""
    free: str
    """What leaves a line free."""

    def __init__(self) -> None:
        self.parts: list[str] = []

    def write_usage(self, program: str, arguments: str) -> None:
        """The first line."""
        self.lines([f"{program} {arguments}"])

    def write_text(self, text: str) -> None:
        """Paragraphs, or lines that are kept, such as the examples below their heading."""
        if text.startswith(_KEPT):
            heading, *lines = text.removeprefix(_KEPT).splitlines()
            self.heading(heading.rstrip(":"))
            self.lines([line.strip() for line in lines])
            return
        for paragraph in text.split("\n\n"):
            self.paragraph(" ".join(paragraph.split()))

    def write_dl(self, rows: Sequence[tuple[str, str]]) -> None:
        """Terms with what they mean."""
        for term, meaning in rows:
            self.term(term, meaning)

    @contextmanager
    def section(self, heading: str) -> Iterator[None]:
        """What is written inside stands below a heading."""
        self.heading(heading)
        yield

    def indentation(self) -> nullcontext[None]:
        """Nothing: marks say what belongs together."""
        return nullcontext()

    def write_paragraph(self) -> None:
        """A line is left free."""
        self.parts.append(self.free)

    @abstractmethod
    def heading(self, text: str) -> None:
        """Of the second level."""

    @abstractmethod
    def paragraph(self, text: str) -> None:
        """Running text."""

    @abstractmethod
    def lines(self, lines: Sequence[str]) -> None:
        """What can be typed."""

    @abstractmethod
    def term(self, term: str, meaning: str) -> None:
        """An option, an argument, a command or a setting."""


class Markdown(Formatter):
    """A page of the site."""

    free = "\n"

    def heading(self, text: str) -> None:
        """`## Options`."""
        self.parts.append(f"\n## {text}\n\n")

    def paragraph(self, text: str) -> None:
        """Nothing in it is taken for a mark but code."""
        self.parts.append(f"{_plain(text)}\n\n")

    def lines(self, lines: Sequence[str]) -> None:
        """A block of code."""
        self.parts.append("\n".join(("```", *lines, "```", "", "")))

    def term(self, term: str, meaning: str) -> None:
        """An entry of a list: tables are too wide for a telephone."""
        self.parts.append(f"* `{term}`: {_plain(meaning)}\n")


class Roff(Formatter):
    """A man page."""

    free = ".PP\n"

    def heading(self, text: str) -> None:
        """`.SH OPTIONS`."""
        self.parts.append(f".SH {_roff(text.upper())}\n")

    def paragraph(self, text: str) -> None:
        """One line: whoever shows it breaks it."""
        self.parts.append(f".PP\n{_roff(text)}\n")

    def lines(self, lines: Sequence[str]) -> None:
        """As they are, indented."""
        self.parts.append("\n".join((".PP", ".nf", ".RS", *map(_roff, lines), ".RE", ".fi", "")))

    def term(self, term: str, meaning: str) -> None:
        """A tagged paragraph."""
        self.parts.append(f".TP\n.B {_roff(term)}\n{_roff(meaning)}\n")


def markdown_pages() -> dict[str, str]:
    """The pages of the site: the program's own by `msgdrop`, a command's by its name."""
    pages = {}
    for name, (command, context) in _commands().items():
        formatter = Markdown()
        command.format_help(context, formatter)
        pages[name] = f"# {context.command_path}\n\n{''.join(formatter.parts)}"
    return pages


def man_pages() -> dict[str, str]:
    """The man pages by their file names: `msgdrop.1`, `msgdrop-train.1`."""
    found = _commands()
    return {
        f"{_page_name(name)}.1": _man_page(name, command, context, found)
        for name, (command, context) in found.items()
    }


def _man_page(name: str, command: Any, context: Any, known: Mapping[str, Any]) -> str:
    formatter, page = Roff(), _page_name(name)
    brief = command.get_short_help_str(limit=200).rstrip(".")
    formatter.parts.append(f'.TH {_roff(page.upper())} 1 "" "{PROGRAM} {__version__}"\n')
    formatter.heading("name")
    formatter.parts.append(f"{_roff(page)} \\- {_roff(brief)}\n")
    formatter.heading("synopsis")
    command.format_usage(context, formatter)
    formatter.heading("description")
    command.format_help_text(context, formatter)
    command.format_options(context, formatter)
    command.format_epilog(context, formatter)
    formatter.heading("exit status")
    _write_page(formatter, _CODES.read_text())
    formatter.heading("see also")
    others = [f"{_page_name(each)}(1)" for each in known if each != name]
    formatter.paragraph(", ".join(others))
    return "".join(formatter.parts)


def _write_page(formatter: Formatter, markdown: str) -> None:
    """A page without its title: paragraphs, and tables as terms with what stands beside them."""
    for block in markdown.strip().split("\n\n")[1:]:
        if not block.startswith("|"):
            formatter.write_text(block.replace("`", ""))
            continue
        for line in block.splitlines()[2:]:
            term, *rest = (cell.strip().replace("`", "") for cell in line.strip("|").split("|"))
            formatter.term(term, "; ".join(rest))


def _commands() -> dict[str, tuple[Any, Any]]:
    """The program and its commands, each with the context that its help is written in."""
    group: Any = typer.main.get_command(app)
    top = group.make_context(PROGRAM, [], resilient_parsing=True)
    found = {PROGRAM: (group, top)}
    for name in group.list_commands(top):
        command = group.commands[name]
        context = command.make_context(name, [], parent=top, resilient_parsing=True)
        found[name] = (command, context)
    return found


def _page_name(command: str) -> str:
    return PROGRAM if command == PROGRAM else f"{PROGRAM}-{command}"


def _plain(text: str) -> str:
    return escape(text, quote=False).replace("*", r"\*")


def _roff(text: str) -> str:
    text = text.replace("\\", r"\e").replace("-", r"\-")
    return rf"\&{text}" if text.startswith((".", "'")) else text


if __name__ == "__main__":
    for file, text in man_pages().items():
        folder = Path(sys.argv[1])
        folder.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(text)
