"""What lies in a folder is what its name says."""

import ast

from tests.test_rooms import ROOT, imports


def test_commands_are_commands() -> None:
    """Each file of `commands` is dispatched by the app; what they share lies in `parts`."""
    folder = ROOT / "msgdrop_cli" / "commands"
    files = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    tree = ast.parse((folder.parent / "app.py").read_text())
    names = {each.name.rpartition(".")[2] for each in imports(tree)}
    assert files <= names
