"""`msgdrop plot`: every figure that the records in a folder allow."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.commands.parts.listing import runs_in
from msgdrop_cli.errors import DefinitionError

if TYPE_CHECKING:
    from msgdrop_cli.analysis.summary import Summary
    from msgdrop_cli.report.write import Folder

app = typer.Typer()


@app.command(epilog=options.examples("plot", "plot other-results"))
def plot(results: options.Folder = Path("results"), json: options.Json = False) -> int:
    """Draw every figure that the records allow.

    RESULTS is a folder (default: results); the figures go to RESULTS/figures, those of what is
    published to figures/published beside it. What is of one question alone is drawn where ablate
    draws it, in a folder of its name.
    """
    from msgdrop_cli.analysis.summary import summarise
    from msgdrop_cli.commands.parts.find_references import references_of
    from msgdrop_cli.commands.parts.show_report import note_left_out
    from msgdrop_cli.report.figures import draw_all

    records = runs_in(results)
    summary = summarise(records, references=references_of(records, results))
    note_left_out(summary)
    paths = [
        path for part, folder in _by_study(summary, results) for path in draw_all(part, folder)
    ]
    if not paths:
        raise DefinitionError(f"{results}: no run is finished yet, so there is nothing to draw")
    if json:
        console.result_json([str(path) for path in paths])
        return 0
    for path in paths:
        if path.suffix == ".png":
            console.result(str(path))
    console.note("beside each: .pdf and .svg for print, .csv with the numbers in it")
    return 0


def _by_study(summary: "Summary", results: Path) -> "Iterator[tuple[Summary, Folder]]":
    """What can be compared, group by group, and where it is drawn.

    A part of a results folder has its own place: its figures are of some of the runs. So has a
    study that was published, wherever it lies.
    """
    from msgdrop_cli.report.write import TABLES, figures_folder, home_of

    is_whole = home_of(results) == results and not (results / TABLES).exists()
    for group in summary.groups:
        arms = summary.arms_of(group)
        asked = {(run.definition, run.overrides) for arm in arms for run in arm.done}
        names = [
            f"{question}-{group.profile}"
            for question, changed in asked
            if is_whole and len(asked) == 1 and not changed
        ]
        part = replace(summary, arms=tuple(arms), tells_origin=is_whole)
        yield part, figures_folder(results, *names)
