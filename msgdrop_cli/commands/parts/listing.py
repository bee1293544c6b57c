"""The runs of a results folder for a command, with a word about what else is there."""

from pathlib import Path

from msgdrop_cli.commands.parts import console
from msgdrop_cli.records.elsewhere import read_elsewhere
from msgdrop_cli.records.remembering import remembering
from msgdrop_cli.records.store import RunRecord, look_through
from msgdrop_cli.report.write import home_of


def runs_in(root: Path) -> list[RunRecord]:
    """Every run in or below a folder, and of a study those that lie in another one.

    What was passed over is told in one note.

    Raises RecordError: no such folder, no run in it, or a damaged record of ours.
    """
    listing = look_through(root)
    if listing.passed_over:
        console.note(f"{root}: {listing.passed_over}")
    return remembering([*listing.records, *read_elsewhere(root)], home_of(root))
