"""What the command line says of numbers that are compared."""

import json
from pathlib import Path

import pytest

from tests.cli_runs import Store, copied_store, filled_store, msgdrop


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs, eight episodes each."""
    return filled_store(tmp_path_factory.mktemp("cli"))


def test_eval_compares_equally_many_episodes(store: Store, tmp_path: Path) -> None:
    """Of eight whole ones the first three stand beside three with broken links."""
    results = copied_store(store, tmp_path).results
    few = ("--broken-links", "0.3", "--episodes", "3", "--workers", "1")
    said = msgdrop("eval", results, *few)
    assert said.code == 0, said.err
    assert "the first 3 evaluation episodes per seed" in " ".join(said.out.split())
    rows = json.loads(msgdrop("eval", results, *few, "--json").out)["results"]
    assert {(row["broken_links"], row["episodes"]) for row in rows} == {(0.0, 3), (0.3, 3)}


def test_figures_leave_out_short_evaluations_with_a_note(store: Store, tmp_path: Path) -> None:
    """Three episodes with broken links are drawn beside no eight whole ones."""
    copy = copied_store(store, tmp_path)
    few = ("--broken-links", "0.3", "--episodes", "3", "--workers", "1")
    assert msgdrop("eval", copy.results, *few).code == 0
    drawn = msgdrop("plot", copy.results)
    assert "left out, with fewer episodes: 4 evaluations" in drawn.err
    assert "broken-links" not in drawn.out
