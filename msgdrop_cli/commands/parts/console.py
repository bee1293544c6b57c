"""The only module that prints: results on stdout, everything else on stderr.

Texts are shown as they are: nothing is taken for markup, and control characters have been removed
where texts were read. rich is loaded only where something is laid out.
"""

import json
import re
import sys
import textwrap
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import groupby
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from rich.console import Console
    from rich.live import Live
    from rich.table import Table as RichTable

    from msgdrop_cli.report.table import Table

_PIPED_WIDTH = 160
"""Columns of a table where there is no terminal to ask."""
_GAP = 2
"""Spaces between two columns."""
_TEXT_WIDTH = 100
"""Lines longer than that are hard to read."""
_MARK = re.compile(r"\* |\d\. ")
_POINT = re.compile(rf"\n(?=\n|{_MARK.pattern})")
"""What begins a point of a text, and where a text is broken before points and paragraphs."""
_VERDICTS = {
    **{"supported": "green", "contradicted": "red", "level": "cyan"},
    **dict.fromkeys(("undecided", "estimate", "under-specified"), "yellow"),
}


def result(text: str) -> None:
    """Show a line of the results."""
    print(text)


def prose(text: str) -> None:
    """Show paragraphs and points as wide as the terminal is, in lines that can be read."""
    width = min(_console(sys.stdout).width, _TEXT_WIDTH)
    for part in _POINT.split(text):
        if part.startswith("\n"):
            print()
        mark = _MARK.match(part)
        hanging = " " * len(mark[0]) if mark else ""
        print(textwrap.fill(" ".join(part.split()), width, subsequent_indent=hanging))


def result_json(value: Any) -> None:
    """Show the results as one JSON document."""
    print(json.dumps(value, indent=2, allow_nan=False))


def note(text: str) -> None:
    """Show something that is not a result."""
    _to_stderr(text)


def error(message: str) -> None:
    """Show what went wrong, in one line."""
    with suppress(OSError):
        sys.stdout.flush()
    _to_stderr(f"msgdrop: error: {message}")


def facts(rows: Mapping[str, str], *, is_result: bool = False) -> None:
    """Show names and values, one pair a line, wrapped beside its name."""
    from rich.table import Table as RichTable
    from rich.text import Text

    grid = RichTable.grid(padding=(0, 2))
    grid.add_column(no_wrap=True, style="dim")
    grid.add_column()
    for name, value in rows.items():
        grid.add_row(Text(name), Text(value))
    if is_result:
        _print(sys.stdout, grid)
    else:
        with suppress(OSError):
            _print(sys.stderr, grid)


def table(shown: "Table", *, numbers_from: int = 1, headings: int = 0) -> None:
    """Show a table of results with its title and caption.

    numbers_from: the first column that holds numbers, which stand to the right. In a table of words
    alone no column is left out for want of room: words go on in the next line. headings: so many of
    the first columns may stand as lines above their rows, where there is no room beside them.
    """
    from rich.padding import Padding
    from rich.text import Text

    console = _console(sys.stdout)
    above = 0
    widths: Sequence[int | None] = [None] * len(shown.headers)  # rich's business
    if numbers_from < len(shown.headers):
        above, widths = _room(shown, headings, console.width)
    beside = range(above, above + len(widths))
    headers = shown.headers[above : beside.stop]
    parts: list[Any] = ["", Text(shown.title, style="bold"), ""]
    rows = [row[: beside.stop] for row in shown.rows]
    if not above:
        parts.append(_grid(headers, rows, widths, numbers_from))
    else:
        parts.append(_grid(headers, (), widths, numbers_from - above))
        for names, alike in groupby(rows, key=lambda row: row[:above]):
            below = [row[above:] for row in alike]
            parts += [Text(", ".join(names)), _grid((), below, widths, numbers_from - above)]
    if left_out := ", ".join(shown.headers[beside.stop :]):
        parts.append(Text(f"(no room here for: {left_out})", style="dim"))
    if shown.caption:
        free = max(0, console.width - _TEXT_WIDTH)
        parts.append(Padding(Text(shown.caption, style="dim"), (1, free, 0, 0)))
    _print(sys.stdout, *parts)


def _room(shown: "Table", headings: int, room: int) -> tuple[int, list[int]]:
    """How many columns go above their rows so that all others fit, and the others' widths."""
    for above in range(headings + 1):
        rows = [row[above:] for row in shown.rows]
        widths = _widths(shown.headers[above:], rows, room)
        if len(widths) == len(shown.headers) - above:
            break
    return above, widths


def _grid(
    headers: Sequence[str], rows: Sequence[Sequence[str]], widths: Sequence[int | None], texts: int
) -> "RichTable":
    """Rows below their headers, or, without any, rows that go on below others."""
    from rich import box
    from rich.table import Table as RichTable
    from rich.text import Text

    grid = RichTable(
        box=box.SIMPLE_HEAD,
        padding=(0, _GAP - 1, 0, 0),
        pad_edge=False,
        header_style="none",
        show_edge=False,
        show_header=bool(headers),
    )
    for number, width in enumerate(widths):
        header = Text(headers[number] if headers else "")
        side: Any = "left" if number < texts else "right"
        # Headers may be broken into lines, numbers never: half a number is a wrong one.
        grid.add_column(header, justify=side, width=width, overflow="fold")
    for row in rows:
        grid.add_row(*map(Text, row))
    return grid


def verdicts(title: str, rows: Sequence[tuple[str, str, str, str]]) -> None:
    """Show claims as paragraphs of (verdict, claim, what was compared, why)."""
    from rich.padding import Padding
    from rich.table import Table as RichTable
    from rich.text import Text

    grid = RichTable.grid(padding=(0, 2))
    grid.add_column(no_wrap=True)
    grid.add_column()
    for verdict, claim, compared, why in rows:
        body = Text.assemble(claim, "\n", (f"{compared}\n{why}", "dim"))
        grid.add_row(
            Text(verdict, style=_VERDICTS.get(verdict, "none")), Padding(body, (0, 0, 1, 0))
        )
    _print(sys.stdout, "", Text(title, style="bold"), "", grid)


class Progress:
    """What is shown while work goes on: a table that stays in place, or a plain line at times."""

    def __init__(self, every_s: float = 30.0) -> None:
        self.live: Live | None = None
        self.every_s = every_s
        self.said_at: float | None = None

    def __enter__(self) -> "Progress":
        if sys.stderr.isatty():
            from rich.live import Live

            screen = _console(sys.stderr)
            self.live = Live(console=screen, auto_refresh=False, transient=True)
            self.live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self.live:
            with suppress(OSError):
                self.live.stop()

    def say(self, text: str) -> None:
        """Show a line that stays."""
        if self.live:
            from rich.text import Text

            with suppress(OSError):
                self.live.console.print(Text(text))
        else:
            note(text)

    def update(
        self, headers: Sequence[str], rows: Sequence[Sequence[str]], total: str, now_s: float
    ) -> None:
        """Show who is at work: cells of text in a table, or `total` once in `every_s`."""
        if self.live:
            with suppress(OSError):
                width = self.live.console.width - len("^C")  # what a terminal echoes must not wrap
                self.live.update(_board(headers, rows, total, width), refresh=True)
        elif self.said_at is None or now_s - self.said_at >= self.every_s:
            if self.said_at is not None:
                note(total)
            self.said_at = now_s


def second_screen() -> "Live":
    """A terminal's second screen, on which one thing at a time is shown; not entered yet."""
    from rich.live import Live

    return Live(console=_console(sys.stdout), screen=True, auto_refresh=False)


def _board(
    headers: Sequence[str], rows: Sequence[Sequence[str]], total: str, width: int
) -> "RichTable":
    from rich.table import Table as RichTable
    from rich.text import Text

    while len(total) > width and "; " in total:  # whole parts go, no number is cut
        total = total.rpartition("; ")[0]
    widths = _widths(headers, rows, width)
    grid = RichTable(box=None, pad_edge=False, padding=(0, _GAP, 0, 0), header_style="dim")
    for number, header in enumerate(headers[: len(widths)]):
        side: Any = "left" if number == 0 else "right"
        grid.add_column(
            Text(header),
            justify=side,
            width=widths[number],
            no_wrap=number == 0,
            overflow="ellipsis",
        )
    for row in rows:
        grid.add_row(*map(Text, row[: len(widths)]))
    outer = RichTable.grid()
    outer.add_column(no_wrap=True, overflow="ellipsis", max_width=width)
    if rows:
        outer.add_row(grid)
    outer.add_row(Text(total, style="bold"))
    return outer


def _widths(headers: Sequence[str], rows: Sequence[Sequence[str]], room: int) -> list[int]:
    """The widths of as many columns as there is room for; headers are broken before numbers are.

    rich would take the room from any column, and cut numbers.
    """
    cells = list(zip(*rows, strict=True)) if rows else [()] * len(headers)
    least = [
        max(map(len, (*cells[number], *header.split()))) for number, header in enumerate(headers)
    ]
    while len(least) > 1 and sum(least) + _GAP * (len(least) - 1) > room:
        least.pop()
    spare = room - sum(least) - _GAP * (len(least) - 1)
    for number in range(len(least)):
        more = min(spare, max(0, len(headers[number]) - least[number]))
        least[number] += more
        spare -= more
    return least


def _print(stream: TextIO, *shown: Any) -> None:
    """Lay out for a terminal; for a file or a pipe without the spaces that fill the lines."""
    console = _console(stream)
    if stream.isatty():
        console.print(*shown, sep="\n")
        return
    with console.capture() as capture:
        console.print(*shown, sep="\n")
    stream.write("".join(f"{line.rstrip()}\n" for line in capture.get().splitlines()))
    stream.flush()


def _console(stream: TextIO) -> "Console":
    from rich.console import Console

    width = None if stream.isatty() else _PIPED_WIDTH
    return Console(file=stream, width=width, markup=False, emoji=False, highlight=False)


def _to_stderr(text: str) -> None:
    with suppress(OSError):  # the terminal may be gone; the work is worth more than the line
        print(text, file=sys.stderr, flush=True)
