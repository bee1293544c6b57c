"""Records for others: each format as an independent reader sees it, whole or not at all."""

import csv
import hashlib
import io
import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.commands.export import _FORMATS
from msgdrop_cli.errors import DefinitionError, RecordError, to_install
from msgdrop_cli.records.store import RunRecord, list_runs
from msgdrop_cli.report.cells import csv_bytes
from msgdrop_cli.report.export import FORMATS, export_files
from msgdrop_cli.report.export_studies import studies_of
from msgdrop_cli.report.write import Folder, write_folder
from tests.cli_runs import msgdrop
from tests.fake_runs import write_run


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two variants in two sizes of a game; one of them has a seed less in the larger one."""
    folder = tmp_path_factory.mktemp("exports")
    for size in ("pursuit-n6", "pursuit-n8"):
        for variant, label in (("dcc", "DCC, plain"), ("md-0.2", "=MD")):
            for seed in (1, 2, 3)[: 2 if (size, variant) == ("pursuit-n8", "dcc") else 3]:
                write_run(
                    folder,
                    variant,
                    seed,
                    catches={0.0: 2 * seed, 0.5: seed},
                    curve=[1.0, float(seed)],
                    environment=size,
                    label=label,
                    run_id=hashlib.sha256(f"{size}{variant}{seed}".encode()).hexdigest()[:8],
                )
    write_run(
        folder,
        "dcc",
        4,
        curve=[1.0, 4.0],
        status="diverged",
        reason="loss is NaN",
        label="DCC, plain",
    )
    return folder


@pytest.fixture(scope="module")
def records(root: Path) -> list[RunRecord]:
    """Twelve of them, one of which diverged."""
    return list_runs(root)


def exported(records: list[RunRecord], name: str) -> dict[str, bytes]:
    """The files of one format."""
    return export_files(name, records, summarise(records))


def rows_of(content: bytes) -> list[dict[str, str]]:
    """A CSV file by Python's reader."""
    return list(csv.DictReader(io.StringIO(content.decode(), newline="")))


def test_csv_has_a_row_for_each_run_and_channel(records: list[RunRecord]) -> None:
    """And one for a run without any; catches of 500 steps over both episodes."""
    rows = rows_of(exported(records, "csv")["results.csv"])
    assert len(rows) == 11 * 2 + 1
    found = {
        (row["environment"], row["variant"], row["seed"], row["channel"]): row["catches_per_500"]
        for row in rows
    }
    assert found["pursuit-n6", "dcc", "3", "links:0.5"] == "3.0"
    [lost] = [row for row in rows if row["status"] == "diverged"]
    assert (lost["reason"], lost["channel"], lost["catches_per_500"]) == ("loss is NaN", "", "")


def test_a_run_has_a_row_under_each_question_that_has_it(tmp_path: Path) -> None:
    """Whoever asks for one question's rows gets all of its seeds; a copy of the same adds none."""
    for number, question in enumerate(("broken-links", "architecture", "broken-links")):
        folder = tmp_path / f"{number}"
        write_run(folder, "dcc", 1, catches={0.0: 2}, definition=question, run_id="01234567")
    rows = rows_of(exported(list_runs(tmp_path), "csv")["results.csv"])
    assert [row["question"] for row in rows] == ["architecture", "broken-links"]


def test_csv_has_the_log_as_it_is(records: list[RunRecord]) -> None:
    """Two windows a run, the diverged one's among them, and no label is a formula."""
    rows = rows_of(exported(records, "csv")["curves.csv"])
    values = [
        (row["seed"], row["env_steps"], row["catches_per_500"])
        for row in rows
        if (row["environment"], row["variant"]) == ("pursuit-n8", "md-0.2")
    ]
    assert values == [
        (seed, step, value)
        for seed in "123"
        for step, value in (("500", "1.0"), ("1000", f"{seed}.0"))
    ]
    assert {row["label"] for row in rows} == {"DCC, plain", "'=MD"}


def test_no_column_is_a_formula() -> None:
    """Metrics are called as records of other people call them."""
    assert csv_bytes(["seed", "=1+1"], [[1, "=2"]]) == b"seed,'=1+1\n1,'=2\n"


def test_parquet_has_the_same_table(records: list[RunRecord]) -> None:
    """Read back by pyarrow, where it is installed."""
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(io.BytesIO(exported(records, "parquet")["results.parquet"]))
    columns = table.to_pydict()
    assert len(columns["seed"]) == 23
    assert columns["label"][-1] == "=MD"
    assert None in columns["catches_per_500"]


def test_parquet_says_what_it_needs(
    records: list[RunRecord], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without pyarrow it is one line with the command."""
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(DefinitionError, match=re.escape(to_install("parquet"))):
        exported(records, "parquet")


def test_marl_eval_gets_equal_runs(records: list[RunRecord]) -> None:
    """Environment, task, algorithm, run, step: the same of each in every task, lists of numbers."""
    [(name, content)] = exported(records, "marl-eval").items()
    assert name == "pursuit-quick-1000.json"
    tasks = json.loads(content)["pursuit"]
    assert list(tasks) == ["pursuit-n6", "pursuit-n8"]
    for algorithms in tasks.values():
        assert list(algorithms) == ["DCC; plain", "=MD"]
        for runs in algorithms.values():
            assert list(runs) == ["seed_1", "seed_2"]
    assert tasks["pursuit-n8"]["=MD"]["seed_2"] == {
        "step_1": {"step_count": 500, "catches_per_500": [1.0]},
        "step_2": {"step_count": 1000, "catches_per_500": [2.0]},
        "absolute_metrics": {"catches_per_500": [4.0]},
    }


def test_rliable_gets_runs_by_games(records: list[RunRecord]) -> None:
    """A table a channel; each algorithm's seeds are those that it has in both games."""
    whole, half = json.loads(exported(records, "rliable")["scores.json"])
    assert (whole["channel"], half["channel"]) == ("links:0", "links:0.5")
    assert whole["games"] == ["pursuit-n6", "pursuit-n8"]
    shapes = {name: np.array(runs).shape for name, runs in whole["scores"].items()}
    assert shapes == {"DCC; plain": (2, 2), "=MD": (3, 2)}
    assert whole["scores"]["=MD"] == [[2.0, 2.0], [4.0, 4.0], [6.0, 6.0]]
    assert whole["left_out"] == ["pursuit-n6: seeds 3 of DCC; plain, which are not in every size"]


def test_a_size_that_was_trained_otherwise_is_another_algorithm(records: list[RunRecord]) -> None:
    """Its arms say so, though all of its size have it: elsewhere they have not."""
    changed = {"overrides": ["algorithm.gamma=0.9"]}
    mixed = [
        replace(each, run={**each.run, **changed}) if each.environment == "pursuit-n8" else each
        for each in records
    ]
    [found] = studies_of(summarise(mixed))
    assert found.algorithms == {}
    assert "pursuit-n8: =MD (gamma=0.9), which is not in every size of the game" in found.left_out


def test_a_research_object_names_every_run(records: list[RunRecord]) -> None:
    """What RO-Crate 1.1 demands, digests of what lies beside it, and why a run is dropped."""
    again = [replace(each, run={**each.run, "definition": "another"}) for each in records]
    files = exported([*records, *again], "ro-crate")
    crate = json.loads(files["ro-crate-metadata.json"])
    assert crate["@context"] == "https://w3id.org/ro/crate/1.1/context"
    graph: dict[str, dict[str, Any]] = {each["@id"]: each for each in crate["@graph"]}
    assert len(graph) == len(crate["@graph"])
    assert graph["ro-crate-metadata.json"]["about"] == {"@id": "./"}
    root = graph["./"]
    assert {"name", "description", "datePublished"} <= set(root)
    for part in root["hasPart"]:
        content = files[part["@id"]]
        assert graph[part["@id"]]["sha256"] == hashlib.sha256(content).hexdigest()
    runs = [graph[each["@id"]] for each in root["mentions"]]
    assert {each["identifier"] for each in runs} == {record.run_id for record in records}
    assert [each["error"] for each in runs if "error" in each] == ["diverged: loss is NaN"]
    dropped = [row for row in rows_of(files["runs.csv"]) if row["counts"] == "False"]
    assert [row["dropped_because"] for row in dropped] == ["diverged: loss is NaN"]


def test_an_export_is_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The one before stays as it was on a full disk, and nothing temporary is left."""
    folder = Folder(tmp_path).at("exports").at("csv")
    write_folder(folder, {"a": b"1", "old": b"2"})
    write_folder(folder, {"a": b"3"})
    assert [path.name for path in (tmp_path / "exports" / "csv").iterdir()] == ["a"]

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(RecordError, match="No space left") as caught:
        write_folder(folder, {"a": b"4"})
    assert caught.value.exit_code == 74
    assert [path.name for path in (tmp_path / "exports").iterdir()] == ["csv"]
    assert (tmp_path / "exports" / "csv" / "a").read_bytes() == b"3"


def test_the_command_writes_beside_the_runs(root: Path) -> None:
    """Paths on stdout, as lines and as JSON; an unknown format names the nearest one."""
    said = msgdrop("export", root, "--format", "rliable")
    assert said.code == 0, said.err
    [path] = said.out.split()
    assert Path(path) == root / "exports" / "rliable" / "scores.json"
    assert json.loads(msgdrop("export", root, "--format", "rliable", "--json").out) == [path]
    wrong = msgdrop("export", root, "--format", "parque")
    assert wrong.code == 2
    assert "parquet" in wrong.err
    assert tuple(FORMATS) == _FORMATS


def test_nothing_finished_nothing_to_compare(tmp_path: Path) -> None:
    """Unfinished runs make a table and no arrays."""
    write_run(tmp_path, "dcc", 1, status="running")
    said = msgdrop("export", tmp_path, "--format", "marl-eval")
    assert said.code == 2
    assert "no runs are finished" in said.err
    assert not (tmp_path / "exports").exists()
