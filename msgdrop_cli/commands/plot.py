"""`msgdrop plot`: every figure that the records in a folder allow."""

from pathlib import Path

import typer

from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.commands.parts.listing import runs_in
from msgdrop_cli.errors import DefinitionError

app = typer.Typer()


@app.command(epilog=options.examples("plot", "plot other-results"))
def plot(results: options.Folder = Path("results"), json: options.Json = False) -> int:
    """Draw every figure that the records allow.

    RESULTS is a folder (default: results); the figures go to RESULTS/figures, those of what is
    published to the figures folder beside it.
    """
    from msgdrop_cli.analysis.summary import summarise
    from msgdrop_cli.commands.parts.find_references import references_of
    from msgdrop_cli.commands.parts.show_report import note_left_out
    from msgdrop_cli.report.figures import draw_all
    from msgdrop_cli.report.write import figures_folder

    records = runs_in(results)
    summary = summarise(records, references=references_of(records, results))
    note_left_out(summary)
    paths = draw_all(summary, figures_folder(results))
    if json:
        console.result_json([str(path) for path in paths])
        return 0
    if not paths:
        raise DefinitionError(f"{results}: no run is finished yet, so there is nothing to draw")
    for path in paths:
        if path.suffix == ".png":
            console.result(str(path))
    console.note("beside each: .pdf and .svg for print, .csv with the numbers in it")
    return 0
