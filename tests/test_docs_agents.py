"""AGENTS.md says what is so: its commands, targets, files and limits are there."""

import re
import shlex

from tests import test_rooms, test_sizes
from tests.cli_runs import ROOT
from tests.markdown import Page, named
from tests.test_docs_site import COMMANDS

PAGE = Page((ROOT / "AGENTS.md").read_text())
LINES = [line.partition("  #")[0].strip() for block in PAGE.code("") for line in block.splitlines()]
PROSE = re.sub(r"```.*?```", "", PAGE.text, flags=re.DOTALL)
UNNAMED = {"__main__", "msgdrop_ablations", "stopping", "signals"}
"""Cold, too, and no rooms that anybody adds to."""


def test_every_line_can_be_typed() -> None:
    """Commands are parsed, targets are the Makefile's, tests exist."""
    makefile = (ROOT / "Makefile").read_text()
    for line in LINES:
        program, *words = shlex.split(line.partition(" #")[0])
        if program == "make":
            target = words[0].replace(".venv", "$(VENV)")
            assert f"\n{target}:" in makefile, line
        elif program.endswith("msgdrop"):
            COMMANDS[words[0]].make_context(words[0], words[1:])
        else:
            assert (ROOT / words[-1]).is_file(), line
    assert len(LINES) == 8


def test_files_and_limits_are_the_houses() -> None:
    """What stands as code and looks like a path is one."""
    paths = [name for name in named(PROSE) if "/" in name and " " not in name]
    assert len(paths) > 5
    assert [path for path in paths if not (ROOT / path).exists()] == []
    limits = [int(number) for number in re.findall(r"up to (\d+)", PROSE)]
    assert limits == [test_sizes.MAX_FILE_LINES, test_sizes.MAX_FUNCTION_LINES]


def test_cold_rooms_are_all_that_are_not_warm() -> None:
    """As the tests of the rooms have it."""
    [line] = re.findall(r"^\* (`app`.*?) load no", PROSE, re.MULTILINE | re.DOTALL)
    assert set(named(line)) == set(test_rooms.ORDER) - set(test_rooms.WARM) - UNNAMED
