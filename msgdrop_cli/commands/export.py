"""`msgdrop export`: records for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.commands.parts.listing import runs_in
from msgdrop_cli.errors import DefinitionError

app = typer.Typer()
_FORMATS = ("csv", "parquet", "marl-eval", "rliable", "ro-crate")


@app.command(epilog=options.examples("export", "export results/published --format marl-eval"))
def export(
    results: options.Folder = Path("results"),
    format: Annotated[
        str,
        typer.Option(
            metavar="|".join(_FORMATS), help="Whose.", autocompletion=lambda: list(_FORMATS)
        ),
    ] = "csv",
    json: options.Json = False,
) -> int:
    """Write the records in a format that other programs read.

    RESULTS is a folder (default: results); the files go to RESULTS/exports/FORMAT, those of what is
    published to exports/published beside it.
    """
    options.check_known(format, _FORMATS, "--format")
    from msgdrop_cli.analysis.summary import summarise
    from msgdrop_cli.report.export import export_files
    from msgdrop_cli.report.write import exports_folder, write_folder

    records = runs_in(results)
    files = export_files(format, records, summarise(records))
    if not files:
        raise DefinitionError(f"{results}: no runs are finished that {format} could compare")
    paths = write_folder(exports_folder(results, format), files)
    if json:
        console.result_json([str(path) for path in paths])
        return 0
    for path in paths:
        console.result(str(path))
    return 0
