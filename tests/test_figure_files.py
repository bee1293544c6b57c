"""The files of a figure: the same bytes in every process, for print, with numbers and run ids."""

import csv
import io
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import matplotlib
import pytest
from matplotlib.text import Text
from PIL import Image

from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.definition.spec import Claim
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.report.cells import csv_bytes
from msgdrop_cli.report.figures import draw_all
from msgdrop_cli.report.settings import own_settings
from msgdrop_cli.report.write import Folder
from tests.cli_runs import ROOT
from tests.fake_runs import GROUP, write_run
from tests.test_figure_settings import DRAW

SUFFIXES = (".png", ".pdf", ".svg", ".csv")


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> list[RunRecord]:
    """Two seeds of one variant whose label is a formula."""
    root = tmp_path_factory.mktemp("figure")
    label = "=cmd|'/C calc'!A0"
    return [write_run(root, "dcc", seed, curve=[1.0, seed], label=label) for seed in (1, 2)]


@pytest.fixture(scope="module")
def files(records: list[RunRecord], tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    """Their learning curve, by suffix."""
    folder = tmp_path_factory.mktemp("drawn")
    return {path.suffix: path for path in draw_all(summarise(records), Folder(folder))}


def test_another_process_writes_the_same_bytes(
    records: list[RunRecord], files: Mapping[str, Path]
) -> None:
    """At another time, with other hashes of texts, whatever is drawn and in each format."""
    root = records[0].path.parents[2]
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
    done = subprocess.run(
        [sys.executable, "-c", DRAW.replace(', suffixes=["png"]', "")],
        cwd=root,
        env={**os.environ, "PYTHONPATH": paths, "PYTHONHASHSEED": "7"},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    again = {path.suffix: path.read_bytes() for path in (root / "figures").iterdir()}
    assert tuple(files) == SUFFIXES
    assert {each for each in SUFFIXES if files[each].read_bytes() != again[each]} == set()


def test_pictures_say_which_runs_they_show(
    records: list[RunRecord], files: Mapping[str, Path]
) -> None:
    """And which matplotlib has drawn them; no picture has a date."""
    runs = f"msgdrop runs: {' '.join(sorted(record.run_id for record in records))}"
    tool = f"matplotlib {matplotlib.__version__}"
    with Image.open(files[".png"]) as picture:
        assert (picture.info["Description"], picture.info["Software"]) == (runs, tool)
    for suffix in (".pdf", ".svg"):
        text = files[suffix].read_bytes().decode("latin-1")
        assert runs in text
        assert tool in text
        assert re.findall(r"CreationDate|ModDate|<dc:date>", text) == []


def test_numbers_are_what_is_drawn(files: Mapping[str, Path]) -> None:
    """Every point of the curve with its band, and its label is no formula of a spreadsheet."""
    rows = list(csv.DictReader(io.StringIO(files[".csv"].read_text())))
    assert [(row["env_steps"], row["value"], row["low"], row["high"]) for row in rows] == [
        ("500", "1.0", "1.0", "1.0"),
        ("1000", "1.5", "1.0", "2.0"),
    ]
    assert {row["label"] for row in rows} == {"'=cmd|'/C calc'!A0"}


@pytest.mark.parametrize("begin", "=+-@")
def test_no_text_is_a_formula(begin: str) -> None:
    """Not behind blanks either; a number keeps its sign and its digits."""
    text = csv_bytes(["a", "b"], [[f" {begin}1", -0.1]]).decode()
    assert text == f"a,b\n' {begin}1,-0.1\n"


def test_figures_have_the_width_of_a_column_or_of_two(tmp_path: Path) -> None:
    """3.25 or 6.75 inches as they are printed, and no letter below 6 points."""
    from msgdrop_cli.analysis.differences import pairs_of
    from msgdrop_cli.report.bars import draw_channels
    from msgdrop_cli.report.differences import draw_differences
    from msgdrop_cli.report.figures import draw_learning
    from msgdrop_cli.report.learning_differences import draw_learning_differences
    from msgdrop_cli.report.rates import draw_dropout_rate

    runs = [
        write_run(tmp_path, name, seed, catches={0.0: 8, 1.0: 1}, algorithm={"rate": rate})
        for name, rate in (("dcc", 0.0), ("md-0.2", 0.2), ("md-0.5", 0.5))
        for seed in (1, 2)
    ]
    summary = summarise(runs)
    claim = Claim(
        says="MD helps", source="l. 1", better="md-0.2", worse="dcc", environment="pursuit-n6",
        metric="catches_per_500", measure="learning",
    )  # fmt: skip
    pairs = pairs_of(summary, GROUP, [claim])
    with own_settings():
        found = [
            *(draw(summary, GROUP) for draw in (draw_learning, draw_dropout_rate, draw_channels)),
            draw_learning_differences(summary, GROUP, pairs),
            draw_differences(summary, GROUP, pairs),
        ]
        figures = [drawn.figure for drawn in found if drawn]
        sizes = [
            float(text.get_fontsize())
            for figure in figures
            for text in figure.findobj(Text)
            if isinstance(text, Text) and text.get_text()
        ]
        widths = [round(figure.get_tightbbox().width, 2) <= 6.75 for figure in figures]
    assert [figure.get_figwidth() for figure in figures] == [6.75] * 4 + [3.25]
    assert all(widths)
    assert min(sizes) >= 6.0
