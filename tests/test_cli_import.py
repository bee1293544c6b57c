"""`msgdrop import`: archives become runs of the results folder, or nothing at all happens."""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import torch

from msgdrop_cli.commands import import_archives
from msgdrop_cli.engine.tensors import read_tensors, write_tensors
from msgdrop_cli.records.archive import install, pack, write_archive
from msgdrop_cli.records.store import RunRecord, find_run, list_runs
from tests.cli_runs import Said, Store, filled_store, msgdrop


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs, trained once."""
    return filled_store(tmp_path_factory.mktemp("import"))


@pytest.fixture(scope="module")
def archive(store: Store) -> Path:
    """All of them in an archive."""
    [path] = pack(list_runs(store.results), store.results.parent, "tiny-quick")
    return path


@pytest.fixture
def one(store: Store, tmp_path: Path) -> RunRecord:
    """A copy of one of them, to be changed."""
    record = list_runs(store.results)[0]
    shutil.copytree(record.path, tmp_path / "one" / record.path.name)
    return list_runs(tmp_path / "one")[0]


def changed(record: RunRecord, **changes: Any) -> RunRecord:
    """The run with other words in its `run.json`."""
    (record.path / "run.json").write_text(json.dumps({**record.run, **changes}))
    return RunRecord(record.path, {**record.run, **changes})


def imported(records: RunRecord, folder: Path) -> Said:
    """What importing an archive of one run says."""
    write_archive(folder / "a.zip", [records])
    return msgdrop("import", folder / "a.zip", "--results", folder / "results")


def files(folder: Path) -> Mapping[str, bytes]:
    """Every file below a folder."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name != "lock"
    }


def test_runs_are_as_they_were(store: Store, archive: Path, tmp_path: Path) -> None:
    """Every file stands where training would have put it, bit for bit."""
    said = msgdrop("import", archive, "--results", tmp_path)
    assert said.code == 0, said.err
    assert files(tmp_path / "runs") == files(store.results / "runs")
    assert "4 runs imported, 0 already there" in said.err
    assert sorted(said.out.splitlines()) == sorted(str(r.path) for r in list_runs(tmp_path))


def test_imported_runs_answer_the_question(store: Store, archive: Path, tmp_path: Path) -> None:
    """`ablate` finds nothing left to train, and `eval` and `publish` see the runs."""
    msgdrop("import", archive, "--results", tmp_path)
    again = store._replace(results=tmp_path).ablate()
    assert "nothing to train" in again.err
    seen = msgdrop("eval", tmp_path, "--episodes", "8", "--workers", "1")
    assert seen.code == 0, seen.err
    where = ("--results", tmp_path, "--to", tmp_path / "published")
    published = msgdrop("publish", store.question, *where)
    assert published.code == 0, published.err
    assert len(list_runs(tmp_path / "published")) == 4


def test_importing_twice_changes_nothing(archive: Path, tmp_path: Path) -> None:
    """A run that is there already is skipped with a line each."""
    msgdrop("import", archive, "--results", tmp_path)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    said = msgdrop("import", archive, archive, "--results", tmp_path)
    assert said.code == 0
    assert said.out == ""
    assert said.err.count("is there already") == 4
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before


def test_run_that_was_evaluated_further_is_the_same(archive: Path, tmp_path: Path) -> None:
    """More episodes here do not make it another run."""
    msgdrop("import", archive, "--results", tmp_path)
    more = ("--broken-links", "all", "--episodes", "8", "--workers", "1")
    assert msgdrop("eval", tmp_path, *more).code == 0
    said = msgdrop("import", archive, "--results", tmp_path)
    assert said.code == 0
    assert said.err.count("is there already") == 4


def test_other_content_is_refused(archive: Path, one: RunRecord, tmp_path: Path) -> None:
    """A run that stands there with other content is kept, and nothing is imported beside it."""
    path = tmp_path / "results" / "runs" / "pursuit-n6" / one.path.name
    shutil.copytree(one.path, path)
    (path / "metrics.jsonl").write_text("")
    before = files(tmp_path / "results")
    said = msgdrop("import", archive, "--results", tmp_path / "results")
    assert said.code == 73
    assert "stands there with other content" in said.err
    assert files(tmp_path / "results") == before


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"status": "interrupted"}, "its status is interrupted, expected done"),
        ({"env_steps": 100}, "it has not been trained to its end"),
        ({"seed": 9}, "environment or seed are not those of its settings"),
        ({"variant": "other"}, "it stands in another run's place"),
        ({"schema": 2}, "schema 2 is unknown"),
        ({"status": "perfect"}, "run.json: status"),
        ({"spec": {}}, "spec: 'environment' is missing"),
    ],
)
def test_what_is_no_finished_run_is_refused(
    one: RunRecord, tmp_path: Path, changes: dict[str, Any], reason: str
) -> None:
    """Each in one clear line with exit code 2, and nothing is written."""
    said = imported(changed(one, **changes), tmp_path)
    assert (said.code, said.out) == (2, "")
    assert reason in said.err
    assert f"{tmp_path / 'a.zip'}: " in said.err
    assert len(said.err.splitlines()) == 1
    assert not (tmp_path / "results").exists()


def test_run_id_is_the_hash_of_the_settings(one: RunRecord, tmp_path: Path) -> None:
    """Settings that were changed afterwards are noticed."""
    spec = one.spec | {"algorithm": one.spec["algorithm"] | {"gamma": 0.5}}
    said = imported(changed(one, spec=spec), tmp_path)
    assert said.code == 2
    assert "its run id is not the one of its settings" in said.err


@pytest.mark.parametrize("name", ["policy.safetensors", "metrics.jsonl", "episodes.jsonl"])
def test_damaged_file_of_a_run_is_refused(one: RunRecord, tmp_path: Path, name: str) -> None:
    """A log or policy that cannot be read was damaged before it was packed."""
    (one.path / name).write_bytes(b"damage\n" * 3)
    said = imported(one, tmp_path)
    assert said.code == 2
    assert f"{name}: " in said.err
    assert not (tmp_path / "results").exists()


def rewritten(path: Path, rows: Callable[[list[dict[str, Any]]], list[dict[str, Any]]]) -> None:
    """Put other rows into a log."""
    read = [json.loads(line) for line in path.read_text().splitlines()]
    path.write_text("".join(json.dumps(row) + "\n" for row in rows(read)))


Rows = list[dict[str, Any]]
LOGS: dict[str, tuple[str, Callable[[Rows], Rows], str]] = {
    "no windows": ("metrics.jsonl", lambda rows: [], "does not end with env_steps 200"),
    "no last window": ("metrics.jsonl", lambda rows: rows[:-1], "does not end with env_steps 200"),
    "falling": ("metrics.jsonl", lambda rows: [rows[1], rows[0], *rows[2:]], "does not follow"),
    "text": (
        "metrics.jsonl",
        lambda rows: [row | {"catches_per_500": "zzz"} for row in rows],
        "catches_per_500 is not a number",
    ),
    "no episodes": ("episodes.jsonl", lambda rows: [], "is empty, or an episode is missing"),
    "doubled": ("episodes.jsonl", lambda rows: rows + rows, "is missing or doubled"),
    "no first episode": ("episodes.jsonl", lambda rows: rows[1:], "is missing or doubled"),
    "uncountable": (
        "episodes.jsonl",
        lambda rows: [row | {"catches": "many"} for row in rows],
        "an episode's row is not readable",
    ),
}


@pytest.mark.parametrize("damage", LOGS)
def test_logs_that_would_break_plot_are_refused(
    one: RunRecord, tmp_path: Path, damage: str
) -> None:
    """They are read as tables and curves read them: one bad log would cost all figures."""
    name, rows, reason = LOGS[damage]
    rewritten(one.path / name, rows)
    said = imported(one, tmp_path)
    assert (said.code, said.out) == (2, "")
    assert f"{name}: " in said.err
    assert reason in said.err
    assert len(said.err.splitlines()) == 1


@pytest.mark.parametrize("metrics", ["zzz", {}, {"catches_per_500": 1}], ids=str)
def test_formulas_that_nobody_can_read_are_refused(
    one: RunRecord, tmp_path: Path, metrics: object
) -> None:
    """Without the environment's formulas a run's episodes are no numbers."""
    said = imported(changed(one, metrics=metrics), tmp_path)
    assert said.code == 2
    assert "run.json: metrics" in said.err


def test_policy_of_other_networks_is_refused(one: RunRecord, tmp_path: Path) -> None:
    """The names and shapes of its tensors are those of the run's settings."""
    write_tensors(one.path / "policy.safetensors", {"weights": torch.zeros(3)})
    said = imported(one, tmp_path)
    assert said.code == 2
    assert "policy.safetensors: does not fit this run" in said.err


@pytest.mark.parametrize("weight", ["nan", "inf"])
def test_policy_that_is_no_number_is_refused(one: RunRecord, tmp_path: Path, weight: str) -> None:
    """It could not be evaluated; training never finishes with one."""
    weights = read_tensors(one.path / "policy.safetensors")
    next(iter(weights.values())).view(-1)[3] = float(weight)
    write_tensors(one.path / "policy.safetensors", weights)
    said = imported(one, tmp_path)
    assert (said.code, said.out) == (2, "")
    assert "policy.safetensors: is damaged: it holds weights that are not finite" in said.err
    assert not (tmp_path / "results").exists()


def test_slower_of_two_imports_finds_the_run(
    archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who looks before the other has written, and writes after, skips the run."""

    def first_the_other(record: RunRecord, target: Path) -> None:
        install(record, target)
        install(record, target)

    monkeypatch.setattr(import_archives, "install", first_the_other)
    said = msgdrop("import", archive, "--results", tmp_path)
    assert said.code == 0, said.err
    assert "0 runs imported, 4 already there" in said.err


def test_one_bad_archive_stops_all(archive: Path, tmp_path: Path) -> None:
    """Everything is checked before anything is written."""
    (tmp_path / "bad.zip").write_bytes(archive.read_bytes()[:-100])
    said = msgdrop("import", archive, tmp_path / "bad.zip", "--results", tmp_path / "results")
    assert said.code == 2
    assert "is no archive of msgdrop, or damaged" in said.err
    assert not (tmp_path / "results").exists()


def test_missing_archive_is_one_line(tmp_path: Path) -> None:
    """A name that is mistyped is said with its reason."""
    said = msgdrop("import", tmp_path / "none.zip")
    assert said.code == 2
    assert "none.zip: cannot be read: No such file or directory" in said.err


def test_folder_that_cannot_be_made_is_73(archive: Path, tmp_path: Path) -> None:
    """A results folder that is a file cannot take runs."""
    (tmp_path / "results").touch()
    said = msgdrop("import", archive, "--results", tmp_path / "results")
    assert said.code == 73, said.err
    assert len(said.err.splitlines()) == 1


def test_json_lists_every_run(archive: Path, tmp_path: Path) -> None:
    """Programs read which runs came and where they stand."""
    rows = json.loads(msgdrop("import", archive, "--results", tmp_path, "--json").out)
    assert len(rows) == 4
    assert all(row["imported"] for row in rows)
    for row in rows:
        record = find_run(tmp_path, row["run_id"])
        assert record is not None
        assert str(record.path) == row["path"]
        assert (record.variant, record.seed) == (row["variant"], row["seed"])
    again = json.loads(msgdrop("import", archive, "--results", tmp_path, "--json").out)
    assert not any(row["imported"] for row in again)
