"""A results folder that refuses or holds damaged files costs no number that was played for."""

import json
import shutil
from pathlib import Path

import pytest

from tests.cli_runs import Store, copied_store, filled_store, msgdrop

PLAY = ("--episodes", "8", "--workers", "1")


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs, trained once; tests that change them take `copy`."""
    return filled_store(tmp_path_factory.mktemp("damage"))


@pytest.fixture
def copy(store: Store, tmp_path: Path) -> Store:
    """The same, to be changed."""
    return copied_store(store, tmp_path)


def test_numbers_come_before_figures_that_cannot_be_written(copy: Store) -> None:
    """The tables stand on stdout, as one JSON document, too; then the figures fail with 73."""
    shutil.rmtree(copy.results / "figures")
    (copy.results / "figures").touch()
    said = msgdrop("unstable-test", copy.results, *PLAY)
    assert said.code == 73
    assert "cannot be created" in said.err.splitlines()[-1]
    assert "DCC-MD 0.2" in said.out
    document = msgdrop("unstable-test", copy.results, *PLAY, "--json")
    assert document.code == 73
    assert json.loads(document.out)["results"]
    assert json.loads(document.out)["figures"] == []


def test_what_cannot_be_summarised_is_not_published(copy: Store) -> None:
    """A damaged log is found before the first run is copied."""
    log = sorted(copy.results.rglob("episodes.jsonl"))[0]
    log.write_text('{"broken_links": 0.0, "episode": 0, "steps": 3}\n')
    folder = copy.results / "published"
    said = msgdrop("publish", copy.question, "--results", copy.results, "--to", folder)
    assert (said.code, said.out) == (2, "")
    assert not list(folder.rglob("run.json"))
