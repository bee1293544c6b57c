"""Runs that nobody has begun: `status` shows them, and they are in nobody's way."""

import json
import shutil
import signal
from collections.abc import Sequence
from pathlib import Path

import pytest

from msgdrop_cli.commands import status
from msgdrop_cli.commands.parts import carry_out, console
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.archive import pack
from msgdrop_cli.records.files import run_lock
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.planned import plan_run, remove_planned
from msgdrop_cli.records.store import create_run, list_runs, run_path, set_status
from msgdrop_cli.scheduler import Task
from msgdrop_cli.stopping import Control
from tests import runs
from tests.cli_runs import Store, copied_store, filled_store, msgdrop


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs, trained once."""
    return filled_store(tmp_path_factory.mktemp("planned"))


@pytest.fixture
def stopped(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    """The same question, stopped before its first run began."""

    def stop(tasks: Sequence[Task], control: Control, **_: object) -> list[Outcome]:
        control.signal = signal.SIGINT
        return []

    with monkeypatch.context() as patch:
        patch.setattr(carry_out, "run_tasks", stop)
        asked = store._replace(results=tmp_path / "results")
        said = asked.ablate()
    assert said.code == 130, said.err
    return asked


def test_status_shows_what_is_still_to_come(stopped: Store) -> None:
    """Every run of a plan that was stopped is there, by its name and at 0%."""
    said = msgdrop("status", stopped.results)
    assert "4 runs: 4 planned" in said.out
    assert said.out.count("0%") == 4
    lines = json.loads(msgdrop("status", stopped.results, "--json").out)
    assert {line["label"] for line in lines} == {"DCC [/red]", "DCC-MD 0.2"}


def test_planned_runs_are_trained_as_new_ones(store: Store, stopped: Store) -> None:
    """The plan calls them new, and what comes out is what came out without the stop."""
    assert "4 runs: 4 new" in stopped.ablate("--dry-run").out
    said = stopped.ablate()
    assert said.code == 0, said.err
    assert said.out == store.said.out.replace(str(store.results), str(stopped.results))


def test_planned_runs_give_way_to_imported_ones(store: Store, stopped: Store) -> None:
    """They have nothing that could be lost."""
    [archive] = pack(list_runs(store.results), stopped.results, "tiny-quick")
    said = msgdrop("import", archive, "--results", stopped.results)
    assert said.code == 0, said.err
    assert "4 runs imported" in said.err
    assert {run.status for run in list_runs(stopped.results)} == {"done"}


def test_a_plan_overwrites_nothing(tmp_path: Path) -> None:
    """A run that is there stays as it is; one that another process works at is left to it."""
    planned = runs.planned()
    path = run_path(tmp_path, planned)
    create_run(path, planned, {})
    set_status(path, "running", env_steps=80)
    plan_run(path, planned)
    assert [(run.status, run.env_steps) for run in list_runs(tmp_path)] == [("running", 80)]
    other = tmp_path / "other"
    with run_lock(other), pytest.raises(RecordError, match="in use"):
        plan_run(other, planned)
    assert not (other / "run.json").exists()


def test_only_what_is_planned_is_removed(tmp_path: Path) -> None:
    """A run that was begun stays; of a planned one's folder what somebody else put there."""
    planned = runs.planned()
    path = run_path(tmp_path, planned)
    plan_run(path, planned)
    (path / "notes.txt").write_text("mine")
    remove_planned(path, planned.run_id)
    assert [file.name for file in path.iterdir()] == ["notes.txt"]
    create_run(path, planned, {})
    set_status(path, "interrupted")
    remove_planned(path, planned.run_id)
    assert (path / "run.json").exists()
    remove_planned(tmp_path / "nowhere", planned.run_id)
    assert not (tmp_path / "nowhere").exists()


def test_published_runs_stand_apart(store: Store, tmp_path: Path) -> None:
    """Own runs come first, one by one; published ones after them, a row for each variant."""
    copy = copied_store(store, tmp_path)
    shutil.copytree(copy.results / "runs", copy.results / "published" / "tiny-quick")
    said = msgdrop("status", copy.results)
    own, published = said.out.split("4 published runs: 4 done")
    assert "4 runs: 4 done" in own
    assert own.count("pursuit-n6") == 4
    assert published.count("pursuit-n6") == 2
    lines = json.loads(msgdrop("status", copy.results, "--json").out)
    assert [line["own"] for line in lines] == [True] * 4 + [False] * 4


def test_copies_of_a_run_are_counted_as_such(store: Store, tmp_path: Path) -> None:
    """Two studies with the same four runs are eight runs and four: every command says both."""
    folder = tmp_path / "results"
    for study in ("one", "other"):
        shutil.copytree(store.results / "runs", folder / "published" / study)
    said = msgdrop("status", folder).out
    assert "8 published runs, 4 distinct: 8 done" in said
    assert "is counted in each of them" in said
    assert (
        "8 runs, 4 distinct, own and published: finished" in msgdrop("status", folder, "--why").out
    )
    assert (
        "8 runs, 4 distinct, own and published: readable"
        in msgdrop("doctor", "--results", folder).out
    )


def test_in_sixty_columns_status_loses_no_column(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is said once for many rows goes above them; no two rows look alike by that."""
    copy = copied_store(store, tmp_path)
    shutil.copytree(copy.results / "runs", copy.results / "published" / "tiny-quick")
    monkeypatch.setattr(console, "_PIPED_WIDTH", 40)
    own, published = msgdrop("status", copy.results).out.split("4 published runs")
    assert "no room" not in own + published
    rows = [line.split() for line in own.splitlines()]
    assert rows.count(["quick", "done", "1", "200", "100%"]) == 2
    assert "pursuit-n6, DCC-MD 0.2" in own.splitlines()
    assert "tiny, pursuit-n6" in published.splitlines()


def test_status_of_many_runs_has_a_row_for_each_arm(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody reads a thousand rows: how many of an arm are how far, and their env steps."""
    monkeypatch.setattr(status, "_MOST_ROWS", 3)
    rows = msgdrop("status", store.results).out.split("\n")
    [row] = [row.split() for row in rows if "DCC-MD 0.2" in row]
    assert row == ["pursuit-n6", "DCC-MD", "0.2", "quick", "done", "2", "400", "100%"]


def test_a_run_at_which_nobody_works_was_killed(tmp_path: Path) -> None:
    """`running` stands in its record until somebody goes on; its lock says who is at work."""
    path = create_run(run_path(tmp_path, runs.planned()), runs.planned(), {}).path
    set_status(path, "running", env_steps=80)

    def words() -> list[str]:
        lines = json.loads(msgdrop("status", tmp_path, "--json").out)
        return [line["status"] for line in lines]

    with run_lock(path):
        assert words() == ["running"]
    assert words() == ["killed"]
    assert "1 run: 1 killed" in msgdrop("status", tmp_path).out


def test_a_study_has_one_place_and_one_name_for_a_figure(store: Store, tmp_path: Path) -> None:
    """`plot` draws it where `ablate` does, and the same; others, and changed runs, go apart."""
    copy = copied_store(store, tmp_path)
    ablated = [
        Path(line.split()[1]) for line in copy.ablate().out.splitlines() if "figure  " in line
    ]
    before = {path: path.read_bytes() for path in ablated}
    assert {path.parent for path in ablated} == {copy.results / "figures" / "tiny-quick"}
    drawn = [Path(line) for line in msgdrop("plot", copy.results).out.splitlines()]
    assert {*drawn} <= {*ablated}
    assert {path: path.read_bytes() for path in drawn} == {path: before[path] for path in drawn}
    [first, *others] = copy.results.rglob("run.json")
    for records, change in (
        ([first], {"definition": "other"}),
        ([first, *others], {"definition": "tiny", "overrides": ["algorithm.gamma=0.9"]}),
    ):
        for record in records:
            record.write_text(json.dumps(json.loads(record.read_text()) | change))
        drawn = [Path(line) for line in msgdrop("plot", copy.results).out.splitlines()]
        assert {path.parent for path in drawn} == {copy.results / "figures"}
