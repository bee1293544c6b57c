"""docs/how-a-figure-is-made.md: every step is where it says, and the figure is made of that run."""

import ast
import re
from pathlib import Path

import pytest

from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.report.write import figures_folder
from tests.cli_runs import ROOT, msgdrop
from tests.fake_runs import write_run
from tests.markdown import DOCS, named, page

PAGE = page("how-a-figure-is-made.md")
STEPS = [row for row in PAGE.rows() if row[0][0].isdigit()]
FILE = re.compile(r"\]\(([^)]+)\): `(\w+)`")


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step[0].replace(" ", "-"))
def test_every_step_stands_where_it_says(step: list[str]) -> None:
    """The function or class is one of the file's own, and public."""
    [(file, name)] = FILE.findall(step[1])
    body = ast.parse((DOCS / file).read_text()).body
    assert name in {each.name for each in body if isinstance(each, ast.FunctionDef | ast.ClassDef)}


def test_the_steps_are_numbered_in_their_order() -> None:
    """Seventeen, none twice."""
    assert [int(step[0].split(".")[0]) for step in STEPS] == list(range(1, 18))


def test_the_run_is_the_one_that_is_planned() -> None:
    """Its id, and that it is among those published, of which the figure was drawn."""
    asked = plan(load_definition("broken-links"), "two-million", catalogue())
    first = ("pursuit-n6", "md-0.2", 1)
    [run] = [
        run for run in asked.runs if (run.spec.environment, run.variant, run.spec.seed) == first
    ]
    [name] = [step for step in STEPS if step[0].startswith("4.")]
    assert named(name[2]) == [run.run_id]
    study = ROOT / "results" / "published" / "broken-links-two-million"
    assert (study / "pursuit-n6" / f"md-0.2-s1-{run.run_id}" / "run.json").is_file()


def test_the_figure_is_called_as_the_page_says(tmp_path: Path) -> None:
    """By what it was made from."""
    [path] = named(STEPS[-1][2])
    folder = figures_folder(Path("results"), "broken-links-two-million")
    assert Path(path).parent == folder.root / folder.inside
    for seed in (1, 2):
        write_run(tmp_path, "dcc", seed, profile="two-million", train_env_steps=2_000_000)
    drawn = [Path(line).name for line in msgdrop("plot", tmp_path).out.splitlines()]
    assert Path(path).name in drawn
