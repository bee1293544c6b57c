"""A study that is continued from a clone: what is published there counts, and stays as it is."""

import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.commands.parts import why
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.records.counted import preferred
from msgdrop_cli.records.store import RunRecord, list_runs, set_status
from msgdrop_cli.report.captions import footer
from tests.cli_runs import QUESTION, Store, filled_store, msgdrop
from tests.test_auto_seeds import HIGH, LOW, MIXED, asked, looks, to_train

CHANNELS = QUESTION.replace("[profiles.quick]", "[profiles.quick]\nbroken_links = [0.0, 0.5]")


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """The tiny question, its four runs trained and published, as they stand in a fresh clone."""
    store = filled_store(tmp_path_factory.mktemp("made"))
    folder = store.results / "published"
    said = msgdrop("publish", store.question, "--results", store.results, "--to", folder)
    assert said.code == 0, said.err
    shutil.rmtree(store.results / "runs")
    return store


@pytest.fixture
def clone(published: Store, tmp_path: Path) -> Store:
    """A clone of one's own."""
    folder = shutil.copytree(published.results / "published", tmp_path / "results" / "published")
    return published._replace(results=folder.parent)


def contents(folder: Path) -> Mapping[Path, bytes]:
    """Every file below a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def words(text: str) -> str:
    """Without the line breaks of the terminal."""
    return " ".join(text.split())


def own_copy(clone: Store, pattern: str) -> Path:
    """A published run as if it had been trained here."""
    [folder] = (clone.results / "published" / "tiny-quick").glob(f"*/{pattern}")
    place = clone.results / "runs" / folder.parent.name / folder.name
    return Path(shutil.copytree(folder, place))


def test_published_runs_are_in_the_plan(clone: Store) -> None:
    """Each of them by its id; the plan says where they lie and how to train them oneself."""
    said = words(clone.ablate("--seeds", "3", "--dry-run").out)
    assert "6 runs: 4 published, 2 new" in said
    assert "counted as they are: tiny-quick (4); to train all yourself: --results" in said
    runs = json.loads(clone.ablate("--seeds", "3", "--dry-run", "--json").out)["runs"]
    assert [run["published"] for run in runs].count(True) == 4
    assert sum("published/tiny-quick" in (run["path"] or "") for run in runs) == 4


def test_only_what_is_published_nowhere_is_trained(clone: Store) -> None:
    """The answer is of all runs and says which are whose; what is published keeps its bytes."""
    before = contents(clone.results / "published")
    said = clone.ablate("--seeds", "3")
    assert said.code == 0, said.err
    assert contents(clone.results / "published") == before
    assert {record.seed for record in list_runs(clone.results / "runs")} == {3}
    assert words(said.out).count("4 of 6 runs published: tiny-quick (4)") == 2  # table and verdict
    document = json.loads(clone.ablate("--seeds", "3", "--json").out)
    [claim] = document["claims"]
    assert sorted(claim["runs"].values()) == ["own"] * 2 + ["published"] * 4
    assert {run["status"] for run in document["runs"]} == {"done"}


def test_figures_say_which_runs_are_published(clone: Store) -> None:
    """Below each of them; what is to be published says nothing of it, for it is all published."""
    own_copy(clone, "dcc-s1-*")
    records = list_runs(clone.results)
    plain = summarise(records)
    [group] = plain.groups
    told = replace(plain, tells_origin=True)
    assert "3 of 4 runs published: tiny-quick (3)" in footer(told, group, told.arms, "")
    assert "published" not in footer(plain, group, plain.arms, "")


def test_elsewhere_everything_is_trained(clone: Store, tmp_path: Path) -> None:
    """Another results folder has nothing that is published."""
    said = clone._replace(results=tmp_path / "mine").ablate("--dry-run")
    assert "4 runs: 4 new" in said.out
    assert "published" not in said.out


def test_an_own_run_comes_before_a_published_one(clone: Store) -> None:
    """Whoever has trained it sees their own."""
    own_copy(clone, "dcc-s1-*")
    assert "4 runs: 1 finished, 3 published" in clone.ablate("--dry-run").out


def test_what_diverged_here_is_not_made_good_by_others(clone: Store) -> None:
    """It stays the worst value; what merely stopped or failed is there, for others finished it."""
    place = own_copy(clone, "dcc-s1-*")
    for status, told in (
        ("diverged", "3 published, 1 diverged"),
        ("failed", "4 published"),
        ("interrupted", "4 published"),
    ):
        set_status(place, status, "NaN", env_steps=20)  # type: ignore[arg-type]
        assert f"4 runs: {told}" in clone.ablate("--dry-run").out


def test_what_is_published_without_these_episodes_is_played_or_trained(
    clone: Store, tmp_path: Path
) -> None:
    """Of each variant one policy is published; the other seed has none to play."""
    question = tmp_path / "tiny.toml"
    question.write_text(CHANNELS)
    asked = clone._replace(question=question)
    said = words(asked.ablate("--dry-run").out)
    assert "4 runs: 2 published, 2 new" in said
    assert "2 of them with fewer than 8 episodes each through none, half: their policies" in said
    assert "2 runs more published with fewer than 8 episodes each through none, half" in said
    before = contents(clone.results / "published")
    document = json.loads(asked.ablate("--json").out)
    assert contents(clone.results / "published") == before
    assert {record.seed for record in list_runs(clone.results / "runs")} == {2}
    half = [row for row in document["results"] if row["broken_links"] == 0.5]
    assert {row["seeds"] for row in half} == {2}
    [claim] = document["claims"]
    assert sorted(claim["runs"].values()) == ["own"] * 2 + ["published"] * 2


def test_damage_counts_only_where_no_other_copy_does(clone: Store) -> None:
    """A damaged published record is no reason to train its run again unasked."""
    study = clone.results / "published" / "tiny-quick"
    shutil.copytree(study, study.with_name("other-quick"))
    [record] = study.glob("*/dcc-s1-*/run.json")
    record.write_text("{")
    assert "4 runs: 4 published" in clone.ablate("--dry-run").out
    shutil.rmtree(study.with_name("other-quick"))
    said = clone.ablate("--dry-run")
    assert said.code == 2
    assert f"{record}: is damaged" in said.err


def test_why_asks_for_nothing_that_is_published(clone: Store) -> None:
    """A run that was stopped here and finished by others is missing nowhere."""
    place = own_copy(clone, "dcc-s1-*")
    record = set_status(place, "interrupted", env_steps=20)
    assert len(why.reasons([record], catalogue())) == 1
    assert why.reasons(list_runs(clone.results), catalogue()) == []


def test_of_published_copies_that_of_the_question_is_counted() -> None:
    """Then the one with a policy; an own one on its way comes last."""

    def copy(place: str, definition: str, status: str = "done") -> RunRecord:
        run = {"definition": definition, "status": status, "env_steps": 1}
        return RunRecord(Path(f"/nowhere/{place}/pursuit-n6/dcc-s1-01234567"), run)

    one, other = copy("published/a-quick", "a"), copy("published/b-quick", "b")
    own = copy("runs", "a", "interrupted")
    assert preferred([own, one, other], "b") == [other, one, own]
    assert preferred([own, other, one], "a") == [one, other, own]
    ended = copy("runs", "a", "diverged")
    assert preferred([one, ended], "a") == [ended, one]


def moved(folder: Path) -> None:
    """What was trained here as somebody's publication."""
    study = folder / "results" / "published" / "tiny-quick"
    study.parent.mkdir()
    (folder / "results" / "runs").rename(study)


def test_auto_looks_at_published_and_own_runs_together(tmp_path: Path) -> None:
    """Both arms of a claim published, the third one own: the next look is that of all."""
    looks(tmp_path, dcc=LOW, md=HIGH)
    moved(tmp_path)
    document = looks(tmp_path, fdc=MIXED)
    assert to_train(document) == {"md-0.2": 2, "fdc": 2}
    assert [each["look"] for each in document["looks"]] == [2]


def test_auto_goes_by_what_is_on_record(tmp_path: Path) -> None:
    """A policy that could be played has not been looked at, so its run is wanted for the look."""
    looks(tmp_path, dcc=LOW, md=HIGH, fdc=LOW)
    moved(tmp_path)
    study = tmp_path / "results" / "published" / "tiny-quick" / "pursuit-n6"
    [short] = study.glob("fdc-s1-*")
    (short / "episodes.jsonl").write_text("")
    (short / "policy.safetensors").write_bytes(b"?")
    said = asked(tmp_path, "--dry-run", "--json")
    assert to_train(json.loads(said.out)) == {"fdc": 1}


def test_published_seeds_are_no_gap(tmp_path: Path) -> None:
    """Seeds 1 to 4 published and 5 and 6 own are seeds 1 to 6."""
    every: dict[str, Any] = {"dcc": LOW, "md": HIGH, "fdc": LOW}
    looks(tmp_path, **every)
    for path in (tmp_path / "results" / "runs").glob("*/*-s[1-4]-*"):
        place = tmp_path / "results" / "published" / "tiny-quick" / path.parent.name / path.name
        place.parent.mkdir(parents=True, exist_ok=True)
        path.rename(place)
    assert to_train(looks_again(tmp_path)) == {}


def looks_again(folder: Path) -> Any:
    """What it would train now."""
    return json.loads(asked(folder, "--dry-run", "--json").out)
