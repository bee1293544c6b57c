"""The spec of a record: typed where it is read, or none."""

from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.records.setup import read_setup
from msgdrop_cli.records.store import list_runs
from tests.cli_runs import ROOT
from tests.runs import planned

SPEC = {
    "environment": {"name": "pursuit-n6"},
    "algorithm": {"learner": "dcc"},
    "training": {"train_env_steps": 5},
    "seed": 1,
}


def test_what_we_write_has_a_setup() -> None:
    """Its tables as they stand there, and what is named of them."""
    run = planned()
    table = spec_to_dict(run.spec)
    setup = read_setup(table)
    assert setup is not None
    assert (setup.learner, setup.train_env_steps) == ("dcc", 480)
    assert [setup.environment, setup.algorithm, setup.training] == [
        table[key] for key in ("environment", "algorithm", "training")
    ]


def test_more_may_stand_there() -> None:
    """A newer program may write tables that this one does not know."""
    assert read_setup(SPEC | {"weather": {}}) == read_setup(SPEC)


@pytest.mark.parametrize("key", ["environment", "algorithm", "training"])
@pytest.mark.parametrize("wrong", [None, [], "x", {}, {"name": 3, "learner": [], "games": 8}])
def test_what_others_write_has_none(key: str, wrong: Any) -> None:
    """No table, or one without what is needed of it."""
    assert read_setup(SPEC) is not None
    assert read_setup(SPEC | {key: wrong}) is None
    assert read_setup({name: table for name, table in SPEC.items() if name != key}) is None


@pytest.mark.parametrize("steps", [0, -1, 1.5, True, "5"])
def test_a_length_is_a_whole_number(steps: Any) -> None:
    """It divides, and names axes."""
    assert read_setup(SPEC | {"training": {"train_env_steps": steps}}) is None


@pytest.mark.parametrize("name", ["../../x", "x" * 900, ""])
def test_names_may_become_names_of_files(name: str) -> None:
    """The one of the game does."""
    assert read_setup(SPEC | {"environment": {"name": name}}) is None


def test_every_published_record_has_a_setup() -> None:
    """All that have ever been published."""
    records = list_runs(Path(ROOT) / "results" / "published")
    assert len(records) > 50
    assert all(record.setup for record in records)
