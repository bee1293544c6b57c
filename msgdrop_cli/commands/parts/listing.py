"""The runs of a results folder for a command, with a word about what else is there."""

from pathlib import Path

from msgdrop_cli.commands.parts import console
from msgdrop_cli.records.elsewhere import runs_of
from msgdrop_cli.records.remembering import remembering
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.report.write import home_of


def runs_in(root: Path) -> list[RunRecord]:
    """Every run in or below a folder, and those that a study in it names in another one.

    What was passed over is told in one note.

    Raises RecordError: no such folder, no run in it, or a damaged record of ours.
    """
    listing = runs_of(root)
    if listing.passed_over:
        console.note(f"{root}: {listing.passed_over}")
    return remembering(listing.records, home_of(root))
