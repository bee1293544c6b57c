"""Figures depend on their records and on our own settings: on nobody's matplotlibrc or backend."""

import os
import subprocess
import sys
from pathlib import Path

import matplotlib
import pytest

from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.report.figures import draw_all
from msgdrop_cli.report.settings import own_settings
from msgdrop_cli.report.write import Folder
from tests.cli_runs import ROOT
from tests.fake_runs import write_run

HOSTILE = "axes.facecolor: red\nfont.family: serif\nsavefig.bbox: tight\nbackend: tkagg\nnonsense\n"
DRAW = """
from pathlib import Path
from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.records.store import list_runs
from msgdrop_cli.report.figures import draw_all
from msgdrop_cli.report.write import Folder
draw_all(summarise(list_runs(Path("runs"))), Folder(Path("figures")), suffixes=["png"])
"""


def drawn(folder: Path) -> bytes:
    """The one figure of a run, drawn in this process."""
    run = write_run(folder, "dcc", 1, label="DCC at 3$ or 4$")
    [path] = draw_all(summarise([run]), Folder(folder / "figures"), suffixes=("png",))
    return path.read_bytes()


def drawn_apart(folder: Path, **environment: str) -> tuple[bytes, str]:
    """The same, drawn by a process that works in `folder`, and what it said on stderr."""
    write_run(folder, "dcc", 1, label="DCC at 3$ or 4$")
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
    done = subprocess.run(
        [sys.executable, "-c", DRAW],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": paths, **environment},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    [path] = (folder / "figures").iterdir()
    return path.read_bytes(), done.stderr


@pytest.mark.parametrize("backend", ["module://matplotlib_inline.backend_inline", "nonsense"])
def test_an_inherited_backend_does_not_matter(backend: str, tmp_path: Path) -> None:
    """A notebook exports its own to every command that is started from it."""
    said = drawn_apart(tmp_path / "apart", MPLBACKEND=backend)
    assert said == (drawn(tmp_path / "here"), "")


def test_a_matplotlibrc_does_not_matter(tmp_path: Path) -> None:
    """Neither the one of the working folder, which cannot even be decoded, nor the named one."""
    folder = tmp_path / "apart"
    folder.mkdir()
    (folder / "matplotlibrc").write_bytes(HOSTILE.encode() + b"\xff")
    (tmp_path / "named").write_text(HOSTILE)
    said = drawn_apart(folder, MATPLOTLIBRC=str(tmp_path / "named"))
    assert said == (drawn(tmp_path / "here"), "")


def test_no_folder_for_matplotlib_is_needed(tmp_path: Path) -> None:
    """Where neither its settings nor its list of fonts can be kept it says nothing about it."""
    (tmp_path / "file").touch()
    said = drawn_apart(tmp_path / "apart", MPLCONFIGDIR=str(tmp_path / "file" / "folder"))
    assert said == (drawn(tmp_path / "here"), "")


def test_settings_of_the_process_do_not_matter(tmp_path: Path) -> None:
    """Whoever draws in their own session has their settings back afterwards, and we ours."""
    plain = drawn(tmp_path / "plain")
    with matplotlib.rc_context({"axes.facecolor": "red", "font.size": 30, "lines.marker": "o"}):
        assert drawn(tmp_path / "styled") == plain
        assert matplotlib.rcParams["axes.facecolor"] == "red"
    with own_settings():
        assert matplotlib.rcParams["axes.facecolor"] == "white"
