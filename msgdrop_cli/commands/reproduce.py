"""`msgdrop reproduce`: the paper on one page, claim by claim, from the records that are there."""

import json as json_text
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.errors import DefinitionError

if TYPE_CHECKING:
    from msgdrop_cli.report.page.content import Page

app = typer.Typer()
_NAME = "reproduce"
_Train = Annotated[
    bool, typer.Option("--train", help="Train what open claims lack first, seed by seed.")
]
_Budget = Annotated[
    str | None,
    typer.Option(
        metavar="TIME", help="With --train: for so long in all, page included, 6h or 90min."
    ),
]


class _Written(NamedTuple):
    """A page, and its files."""

    page: "Page"
    paths: list[Path]


@app.command(epilog=options.examples("reproduce", "reproduce --train --budget 6h"))
def reproduce(
    results: options.Folder = Path("results"),
    train: _Train = False,
    budget: _Budget = None,
    workers: options.Workers = options.WORKERS,
    device: options.Device = "cpu",
    json: options.Json = False,
) -> int:
    """Put the paper on one page, claim by claim.

    Every claim of every question with its verdict under each reading that has runs, what would
    decide it, and the command that makes its row again: RESULTS/reproduce.html, which needs
    nothing else, reproduce.md and reproduce.json. Nothing is trained unless --train asks for it.
    """
    options.check_workers(workers)
    options.check_device_name(device)
    if budget is not None and not train:
        raise DefinitionError("--budget: of what? it is the time that --train may take")
    code = _train(results, budget, workers, device) if train else 0
    console.note("judging every claim on what is on record")
    page, paths = _written(results, workers, device, may_be_empty=train)
    for altered in page.altered:
        console.note(altered)
    for each in page.dropped:
        if each.what == "unreadable":
            console.note(each.reason)
            code = max(code, 2)
    if json:
        console.result_json(page.document())
    else:
        _show(page, paths)
    return code


def _train(results: Path, budget: str | None, workers: int, device: str) -> int:
    began = time.monotonic()
    from msgdrop_cli.commands.parts.estimate import check_folder
    from msgdrop_cli.commands.parts.paper_page import train
    from msgdrop_cli.commands.parts.train_missing import Means, seconds
    from msgdrop_cli.report.write import home_of

    budget_s = None if budget is None else seconds(budget)
    options.check_device(device)
    if budget_s is None:
        return train(results, Means(workers=workers, device=device, ends=None))
    check_folder(home_of(results), 0)
    # The page of before, which is there whatever happens, says how long the one after takes.
    page_began = time.monotonic()
    _written(results, workers, device, may_be_empty=True)
    page_s = time.monotonic() - page_began
    return train(results, Means(workers=workers, device=device, ends=began + budget_s - page_s))


def _written(results: Path, workers: int, device: str, *, may_be_empty: bool) -> _Written:
    """The page of the records in or below a folder, as files."""
    from msgdrop_cli.commands.parts.paper_page import paper_page
    from msgdrop_cli.report.page.html import html
    from msgdrop_cli.report.page.markdown import markdown
    from msgdrop_cli.report.write import Folder, home_of, write_atomic

    page = paper_page(results, workers=workers, device=device)
    if not page.makers and not may_be_empty:
        raise DefinitionError(
            f"{results}: no finished run of a shipped question is there, so there is no page"
        )
    text = json_text.dumps(page.document(), indent=1, allow_nan=False) + "\n"
    folder = Folder(home_of(results))
    contents = {"html": html(page), "md": markdown(page), "json": text.encode()}
    paths = [write_atomic(folder, f"{_NAME}.{kind}", made) for kind, made in contents.items()]
    return _Written(page, paths)


def _show(page: "Page", paths: list[Path]) -> None:
    under, other = page.under_readings(), page.other_readings()
    console.facts(
        {
            word: f"{page.counts[word]}"
            + (f" ({under[word]} under {other})" if under[word] else "")
            for word in page.words
        },
        is_result=True,
    )
    console.result("")
    for path in paths:
        console.result(f"wrote  {path}")
