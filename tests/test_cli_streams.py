"""Streams that are closed, broken, narrow or of another alphabet; most of it in real processes."""

import io
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from rich.console import Console

from msgdrop_cli.commands.parts import console
from tests.cli_runs import ROOT

HEADERS = ("run", "env steps", "done", "env steps/s", "now", "left")
ROW = ("DCC-MD 0.2, seed 1", "1,234,567", "12%", "1,987", "8.76 catches per 500", "1:23 h")
TOTAL = "1 of 4 runs done; 1,234,567 of 20,000,000 env steps; 1,987/s, 1:23 h left"


def shell(line: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    """Run a line of bash in which `msgdrop` is the program of this checkout."""
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
    program = f'msgdrop() {{ "{sys.executable}" -m msgdrop_cli "$@"; }}; '
    return subprocess.run(
        ["bash", "-c", program + line],
        env={**os.environ, "PYTHONPATH": paths, **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_no_mistake(closed: str) -> None:
    """A closed stream is like /dev/null: what it would say is lost, and nothing else."""
    done = shell(f"msgdrop ablate {closed}")
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    assert ("blockwise-vs-elementwise" in done.stdout) == (">&-" not in closed.replace("2>&-", ""))


@pytest.mark.parametrize("arguments", ["--help", "ablate", "ablate --json"])
def test_a_reader_that_has_gone_is_141(arguments: str) -> None:
    """`| head`, by way of click or not: 141, and no word about it."""
    done = shell(f"msgdrop {arguments} | true; exit ${{PIPESTATUS[0]}}", PYTHONUNBUFFERED="1")
    assert done.returncode == 141
    assert "Error" not in done.stderr


def test_letters_that_an_encoding_lacks_are_replaced(tmp_path: Path) -> None:
    """ASCII output of a label that is not ASCII is shown with question marks."""
    question = tmp_path / "own.toml"
    text = (ROOT / "ablations/msgdrop_ablations/blockwise-vs-elementwise.toml").read_text()
    question.write_text(text.replace('title = "', 'title = "\u6d88\u606f ', 1))
    done = shell(f"msgdrop ablate {question} --dry-run", PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    assert "?? " in done.stdout


def drawn(width: int, rows: Sequence[Sequence[str]], total: str) -> str:
    """The live board on a terminal of this width."""
    screen = Console(file=io.StringIO(), width=width, markup=False, highlight=False)
    with screen.capture() as capture:
        screen.print(console._board(HEADERS, rows, total, width))
    return capture.get()


@pytest.mark.parametrize("width", [20, 30, 40, 60, 80, 120])
def test_the_board_drops_columns_and_cuts_no_number(width: int) -> None:
    """Every number on the board is whole; what has no room is left out from the right."""
    board = drawn(width, [ROW, ROW], TOTAL)
    assert max(map(len, board.splitlines())) <= width
    assert "\u2026" not in board or width < len(ROW[0])
    told = [cell for cell in ROW if cell in board]
    assert told == list(ROW[: len(told)])
    assert (len(told) == len(ROW)) == (width >= 80)
    assert TOTAL.startswith(board.splitlines()[-1].strip())


def test_the_board_of_a_wide_terminal_says_everything() -> None:
    """The whole total stands below the rows."""
    assert TOTAL in drawn(120, [ROW], TOTAL)
