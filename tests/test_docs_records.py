"""docs/records.md names every key that a record has, and no other."""

import json
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from msgdrop_cli.definition.spec import TrainingSpec
from msgdrop_cli.engine.checkpoint import Counters
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.tensors import read_tensors
from msgdrop_cli.records.planned import plan_run
from msgdrop_cli.records.references import Policy, References
from msgdrop_cli.records.store import FACTS, RunRecord, list_runs, run_path
from msgdrop_envs import registry
from tests.cli_runs import ROOT
from tests.markdown import Page, named, page
from tests.runs import StopAt, planned

PAGE = page("records.md")
PUBLISHED_FOLDER = ROOT / "results" / "published"
PUBLISHED = list_runs(ROOT / "results" / "published")
LATER = {"overrides", "registration", "pretraining", "node", "cpu_time_s"}
"""Keys of `run.json` that the page says older records, or runs without an encoder, do not have."""
CHANNELS = {"broken_links", "channel"}


class Stopped(NamedTuple):
    """What lies in a run's folder while it trains, and after it was stopped."""

    path: Path
    progress: dict[str, Any]
    manifest: dict[str, Any]


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Stopped:
    """A run that was looked at when it had logged a row, and stopped then."""
    root, run = tmp_path_factory.mktemp("results"), planned()
    seen: dict[str, Any] = {}
    enough = StopAt(20)

    def stop() -> bool:
        seen.update(json.loads((run_path(root, run) / "progress.json").read_text()))
        return enough()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
        [outcome] = train_cohort([run], root, stop=stop)
    [manifest] = (outcome.path / "checkpoints").glob("*/MANIFEST.json")
    return Stopped(outcome.path, seen, json.loads(manifest.read_text()))


def test_every_file_of_a_run_is_named(stopped: Stopped) -> None:
    """What lies there while it trains, and the files that come at the end."""
    there = {f"{path.name}/" if path.is_dir() else path.name for path in stopped.path.iterdir()}
    later = {"policy.safetensors", "episodes.jsonl", "progress.json", "run.sha256"}
    [files] = [each for each in PAGE.text.split("\n\n") if each.startswith("| file |")]
    assert Page(files).keys() == there | later


def test_run_json_key_by_key(stopped: Stopped) -> None:
    """In the order of the file, with all facts that the engine knows."""
    listed = [name for row in PAGE.section("`run.json`").rows() for name in named(row[0])]
    written = list(json.loads((stopped.path / "run.json").read_text()))
    assert [key for key in listed if key not in ("pretraining", "node")] == written
    assert set(FACTS) <= set(listed)


def test_a_planned_run_has_the_keys_down_to_created(tmp_path: Path) -> None:
    """As the page says below the table."""
    plan_run(run_path(tmp_path, planned()), planned())
    [record] = list_runs(tmp_path)
    listed = [row[0].strip("`") for row in PAGE.section("`run.json`").rows()]
    assert list(record.run) == listed[: listed.index("created") + 1]


def test_published_records_have_the_keys_of_the_page() -> None:
    """All of them, but for those that came later."""
    listed = PAGE.section("`run.json`").keys()
    assert len(PUBLISHED) > 100
    for record in PUBLISHED:
        assert set(record.run) <= listed
        assert listed - set(record.run) <= LATER


def test_the_spec_key_by_key(stopped: Stopped) -> None:
    """Its tables, the fields of a training, and which of them are in no run id or came later."""
    section = PAGE.section("`spec`")
    record = json.loads((stopped.path / "run.json").read_text())
    assert section.keys() == set(record["spec"])
    [training] = [row[1] for row in section.rows() if row[0] == "`training`"]
    assert named(training) == [field.name for field in fields(TrainingSpec)]
    marks = {field.name: dict(field.metadata) for field in fields(TrainingSpec) if field.metadata}
    assert marks == {"checkpoint_every_env_steps": {"cosmetic": True}, "channel": {"later": True}}


def columns(record: RunRecord, rows: list[dict[str, Any]]) -> set[str]:
    """The columns of a log, without the metrics that `run.json` names."""
    assert rows
    return set().union(*rows) - set(record.run["metrics"])


def one_of_each_game() -> list[RunRecord]:
    """A published run of every learner and game."""
    found = {(run.environment, run.spec["algorithm"]["learner"]): run for run in PUBLISHED}
    return list(found.values())


def test_the_log_of_the_training_column_by_column() -> None:
    """The metrics by name, and the page's columns; MADDPG has no epsilon."""
    section = PAGE.section("`metrics.jsonl`")
    listed = {n for row in section.rows() if "run.json" not in row[0] for n in named(row[0])}
    for record in one_of_each_game():
        kin = record.spec["algorithm"]["learner"] == "dcc"
        assert columns(record, record.metrics()) == listed - (set() if kin else {"epsilon"})


def test_the_log_of_episodes_column_by_column() -> None:
    """One of the two words for the channel, the page's columns, and the game's own counts."""
    rows = PAGE.section("`episodes.jsonl`").rows()
    counts = {row[0].partition(":")[0]: named(row[0]) for row in rows if ":" in row[0]}
    common = {name for row in rows if ":" not in row[0] for name in named(row[0])}
    assert common > CHANNELS
    for record in one_of_each_game():
        game = record.environment.partition("-")[0]
        assert counts[game] == list(registry.make(record.environment).counts)
        for episode in (row for played in record.episodes().values() for row in played):
            assert set(episode) - common == set(counts[game])
            assert len(set(episode) & CHANNELS) == 1


def test_policies_have_the_tensors_of_the_page() -> None:
    """Pairs of a weight and a bias, stacked as it says; nothing is listed that no policy has."""
    found: set[str] = set()
    files = [*PUBLISHED_FOLDER.glob("*/*/*/policy.safetensors")]
    assert {file.parts[-3] for file in files} == {run.environment for run in one_of_each_game()}
    for file in files:
        for name, tensor in read_tensors(file).items():
            layer, part = name.split(".")
            assert (tensor.dim(), part in ("weight", "bias")) == (3, True)
            assert part == "weight" or tensor.shape[1] == 1
            found.add(layer)
    assert PAGE.section("`policy.safetensors`").keys() == found


def test_progress_key_by_key(stopped: Stopped) -> None:
    """What people are shown while it trains."""
    assert PAGE.section("`progress.json`").keys() == set(stopped.progress)
    assert stopped.progress["phase"] == "training"


def test_a_manifest_key_by_key(stopped: Stopped) -> None:
    """With its counters, and what it says of each file."""
    section = PAGE.section("`checkpoints/`")
    assert section.keys() == set(stopped.manifest)
    cells = {row[0]: named(row[1]) for row in section.rows()}
    assert cells["`counters`"] == [field.name for field in fields(Counters)]
    assert all(list(each) == cells["`files`"] for each in stopped.manifest["files"].values())


def test_references_key_by_key() -> None:
    """Both levels of the file."""
    section = PAGE.section("`references/<environment>-<id>.json`")
    assert section.keys() == {field.name for field in fields(References)}
    [policies] = [named(row[1]) for row in section.rows() if row[0] == "`policies`"]
    assert policies == [field.name for field in fields(Policy)]


def test_the_example_is_what_the_table_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five lines of anybody's Python give the catches that the product computes."""
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {}
    [code] = PAGE.code("python")
    exec(code, names)
    [record] = list_runs(ROOT / names["folder"])
    played = next(rows for channel, rows in record.episodes().items() if channel.key == "links:0")
    expected = 500 * sum(row["catches"] for row in played) / sum(row["steps"] for row in played)
    assert names["catches_per_500"] == expected
