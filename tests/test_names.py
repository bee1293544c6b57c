"""What lies in a folder is what its name says."""

from msgdrop_cli import app
from tests.test_rooms import ROOT


def test_commands_are_commands() -> None:
    """Each file of `commands` is dispatched by the app; what they share lies in `parts`."""
    folder = ROOT / "msgdrop_cli" / "commands"
    files = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    assert files == {*app.COMMANDS.values()}
