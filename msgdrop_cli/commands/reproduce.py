"""`msgdrop reproduce`: the paper on one page, claim by claim, from the records that are there."""

import json as json_text
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from msgdrop_cli.commands.parts import console, options

if TYPE_CHECKING:
    from msgdrop_cli.report.page.content import Page

app = typer.Typer()
_NAME = "reproduce"


@app.command(epilog=options.examples("reproduce", "reproduce other-results", "reproduce --json"))
def reproduce(results: options.Folder = Path("results"), json: options.Json = False) -> int:
    """Put the paper on one page, claim by claim.

    Every claim of every question with its verdict under each reading that has runs, what would
    decide it, and the command that makes its row again: RESULTS/reproduce.html, which needs
    nothing else, reproduce.md and reproduce.json. Nothing is trained.
    """
    from msgdrop_cli.commands.parts.paper_page import paper_page
    from msgdrop_cli.report.page.html import html
    from msgdrop_cli.report.page.markdown import markdown
    from msgdrop_cli.report.write import pages_folder, write_atomic

    page = paper_page(results)
    document = page.document()
    text = json_text.dumps(document, indent=1, allow_nan=False) + "\n"
    folder = pages_folder(results)
    contents = {"html": html(page), "md": markdown(page), "json": text.encode()}
    paths = [write_atomic(folder, f"{_NAME}.{kind}", made) for kind, made in contents.items()]
    if json:
        console.result_json(document)
        return 0
    _show(page, paths)
    return 0


def _show(page: "Page", paths: list[Path]) -> None:
    under, other = page.under_readings(), page.other_readings()
    console.facts(
        {
            word: f"{count}" + (f" ({under[word]} under {other})" if under[word] else "")
            for word, count in page.counts.items()
        },
        is_result=True,
    )
    console.result("")
    for path in paths:
        console.result(f"wrote  {path}")
