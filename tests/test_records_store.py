"""Run folders: found by what stands in them, refused in one line when it is damaged."""

import json
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.run_id import spec_from_dict
from msgdrop_cli.definition.spec import Registration
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.counted import preferred
from msgdrop_cli.records.files import append_jsonl
from msgdrop_cli.records.store import (
    RunRecord,
    create_run,
    find_run,
    list_runs,
    run_path,
    set_status,
)
from tests.definition_samples import CATALOGUE, DEFINITION

RUNS = plan(DEFINITION, "quick", CATALOGUE).runs


def created(root: Path, number: int = 0, **facts: Any) -> RunRecord:
    """A fresh record of one of the planned runs."""
    return create_run(run_path(root, RUNS[number]), RUNS[number], facts)


def rewritten(record: RunRecord, **changes: Any) -> None:
    """Changes `run.json` behind the program's back."""
    (record.path / "run.json").write_text(json.dumps({**record.run, **changes}))


def refusal(root: Path) -> str:
    """The line with which `list_runs` refuses a folder."""
    with pytest.raises(RecordError) as caught:
        list_runs(root)
    assert str(caught.value).isprintable()
    assert caught.value.exit_code == 2
    return str(caught.value)


def test_a_run_has_its_place(tmp_path: Path) -> None:
    """The folder says environment, variant, seed and id."""
    expected = tmp_path / "runs" / "tiny-n2" / f"high-s4-{RUNS[0].run_id}"
    assert run_path(tmp_path, RUNS[0]) == expected


def test_a_new_record_says_what_is_planned(tmp_path: Path) -> None:
    """Everything that the plan knows can be read back, the spec as an equal object."""
    record = created(tmp_path, host="here", threads=1)
    assert (record.run_id, record.variant, record.label) == (RUNS[0].run_id, "high", "High")
    assert (record.environment, record.seed, record.status) == ("tiny-n2", 4, "planned")
    assert (record.definition, record.profile, record.env_steps) == ("sample", "quick", 0)
    assert spec_from_dict(record.spec, CATALOGUE) == RUNS[0].spec
    assert (record.run["host"], record.run["threads"], record.reason) == ("here", 1, None)


def test_a_record_says_what_was_registered_when_it_was_planned(tmp_path: Path) -> None:
    """It is no part of the run: the id and the folder stay; older records have none."""
    rule = Registration(looks=(6,), alpha_spent=(0.05,))
    registered = plan(replace(DEFINITION, registration=rule), "quick", CATALOGUE).runs[0]
    assert registered.run_id == RUNS[0].run_id
    record = create_run(run_path(tmp_path, registered), registered, {})
    assert re.fullmatch("sample:[0-9a-f]{8}", record.registration or "")
    older = {key: value for key, value in record.run.items() if key != "registration"}
    (record.path / "run.json").write_text(json.dumps(older))
    assert list_runs(tmp_path)[0].registration is None


def test_a_record_is_never_created_over_another(tmp_path: Path) -> None:
    """The second one is refused with 73."""
    created(tmp_path)
    with pytest.raises(RecordError, match="exists already") as caught:
        created(tmp_path)
    assert caught.value.exit_code == 73


def test_a_results_folder_that_cannot_be_made_is_73(tmp_path: Path) -> None:
    """A file stands where the folder should be."""
    (tmp_path / "results").write_text("")
    with pytest.raises(RecordError, match="cannot be created") as caught:
        created(tmp_path / "results")
    assert caught.value.exit_code == 73


def test_a_status_is_kept_with_its_reason_and_facts(tmp_path: Path) -> None:
    """The reason becomes one line; other facts stay."""
    path = created(tmp_path, host="here").path
    record = set_status(path, "diverged", "loss\n is  NaN", env_steps=7)
    assert (record.status, record.reason, record.env_steps) == ("diverged", "loss is NaN", 7)
    assert record.run["host"] == "here"
    assert list_runs(path) == [record]


def test_unknown_words_are_mistakes_of_ours(tmp_path: Path) -> None:
    """A status or a fact that readers do not know is never written."""
    path = created(tmp_path).path
    with pytest.raises(ValueError, match="no status is called"):
        set_status(path, "finished")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="not a fact of a run: seed"):
        set_status(path, "done", seed=3)


def test_runs_are_found_from_every_folder_above(tmp_path: Path) -> None:
    """Results, runs, an environment, one run: each lists what is in or below it."""
    records = sorted((created(tmp_path, number) for number in range(4)), key=lambda r: r.path)
    for root in (tmp_path, tmp_path / "runs", tmp_path / "runs" / "tiny-n2"):
        assert list_runs(root) == records
    assert list_runs(records[1].path) == [records[1]]


def test_other_peoples_files_are_no_runs(tmp_path: Path) -> None:
    """Files and folders without `run.json` are passed over, and a run's own are not entered."""
    record = created(tmp_path)
    (tmp_path / "figures").mkdir()
    (tmp_path / "README.md").write_text("x")
    (record.path / "checkpoints").mkdir()
    (record.path / "checkpoints" / "run.json").write_text("x")
    assert list_runs(tmp_path) == [record]


@pytest.mark.parametrize("name", ["missing", "empty", "file", "loop"])
def test_a_folder_without_runs_is_one_clear_line(tmp_path: Path, name: str) -> None:
    """Missing, empty, a file, a link to itself: the line begins with the path."""
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    assert refusal(tmp_path / name).startswith(f"{tmp_path / name}: ")


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"schema": 2}, "schema 2 is unknown, expected 1"),
        ({"schema": "1"}, "schema 1 is unknown, expected 1"),
        ({"status": "finished"}, "status: expected one of planned, running, done"),
        ({"seed": "1"}, "seed: expected a whole number, not '1'"),
        ({"variant": "../x"}, "variant is not a name"),
        ({"env_steps": -1}, "env_steps and wall_time_s cannot be negative"),
        ({"wall_time_s": 1e308}, "wall_time_s is beyond 1e+100"),
        ({"spec": []}, "spec: expected a table, not a list"),
        ({"label": "\x1b"}, "label: expected a line of text, not ''"),
    ],
)
def test_a_damaged_record_names_file_and_key(
    tmp_path: Path, changes: dict[str, Any], problem: str
) -> None:
    """Each wrong value is found and named."""
    record = created(tmp_path)
    rewritten(record, **changes)
    message = refusal(tmp_path)
    assert message.startswith(f"{record.path / 'run.json'}: ")
    assert problem in message


@pytest.mark.parametrize("content", ["", "{", "[]", "null", '{"schema": 1}', '{"schema": true}'])
def test_a_torn_record_is_refused(tmp_path: Path, content: str) -> None:
    """Half a file, no object, or no more than a schema."""
    record = created(tmp_path)
    (record.path / "run.json").write_text(content)
    assert refusal(tmp_path).startswith(f"{record.path / 'run.json'}: ")


def test_a_run_is_found_by_its_id(tmp_path: Path) -> None:
    """Also beside a damaged record of another run; an unknown id and no folder give none."""
    record, other = created(tmp_path, 0), created(tmp_path, 1)
    (other.path / "run.json").write_text("{")
    assert find_run(tmp_path, record.run_id) == record
    assert find_run(tmp_path, "00000000") is None
    assert find_run(tmp_path / "missing", record.run_id) is None


def test_of_two_copies_the_finished_one_is_found(tmp_path: Path) -> None:
    """A published run counts more than one that was interrupted."""
    published, again = tmp_path / "published", tmp_path / "again"
    done = set_status(created(published).path, "done", env_steps=5)
    set_status(created(again).path, "interrupted", env_steps=4)
    assert find_run(tmp_path, RUNS[0].run_id) == done


def test_the_copy_that_is_found_is_the_one_that_counts(tmp_path: Path) -> None:
    """What diverged has ended, and is not gone on with where another copy has come further."""
    lost, longer = created(tmp_path / "a"), created(tmp_path / "b")
    lost = set_status(lost.path, "diverged", "NaN", env_steps=5)
    longer = set_status(longer.path, "interrupted", env_steps=9)
    assert preferred([longer, lost]) == [lost, longer]
    assert find_run(tmp_path, lost.run_id) == lost


def test_logs_are_read_with_the_record(tmp_path: Path) -> None:
    """No log yet means no rows; episodes can be asked for by channel."""
    record = created(tmp_path)
    assert (record.metrics(), record.episodes()) == ([], {})
    append_jsonl(record.path / "metrics.jsonl", {"env_steps": 5})
    rows = [{"broken_links": links, "episode": 0} for links in (0.0, 0.5)]
    append_jsonl(record.path / "episodes.jsonl", *rows)
    assert record.metrics() == [{"env_steps": 5}]
    assert record.episodes() == {Channel.read(row["broken_links"]): [row] for row in rows}


def test_a_log_of_something_else_is_refused(tmp_path: Path) -> None:
    """A row without its number is named by file and line."""
    record = created(tmp_path)
    append_jsonl(record.path / "metrics.jsonl", {"env_steps": 5}, {"env_steps": None})
    with pytest.raises(RecordError, match=r"metrics\.jsonl: line 2: 'env_steps' is not a number"):
        record.metrics()


def test_an_episode_needs_its_number(tmp_path: Path) -> None:
    """Evaluations are sorted by it, so a row without one is refused where it is read."""
    record = created(tmp_path)
    append_jsonl(record.path / "episodes.jsonl", {"broken_links": 0.0, "steps": 3})
    with pytest.raises(RecordError, match=r"episodes\.jsonl: line 1: 'episode' is not a number"):
        record.episodes()


def test_no_run_is_found_where_no_folder_can_be(tmp_path: Path) -> None:
    """A name that is too long holds no runs; whoever creates it says why that fails."""
    assert find_run(tmp_path / ("x" * 300), "12345678") is None


def test_a_copy_that_is_being_made_is_no_run(tmp_path: Path) -> None:
    """Another process, or one that was killed, may have a folder there that is not yet a run's."""
    record = created(tmp_path)
    shutil.copytree(record.path, record.path.parent / ".tmp-x" / "run")
    assert [each.path for each in list_runs(tmp_path)] == [record.path]


def test_folders_that_are_too_deep_are_one_clear_line(tmp_path: Path) -> None:
    """A thousand folders in each other hold no runs of ours."""
    before, depth = Path.cwd(), 1_100
    os.chdir(tmp_path)
    try:
        for _ in range(depth):  # step by step: the whole path is longer than a call may name
            Path("d").mkdir()
            os.chdir("d")
        assert refusal(tmp_path).startswith(f"{tmp_path}: holds no runs of msgdrop")
    finally:
        for _ in range(depth):  # nor could pytest remove it
            os.chdir("..")
            Path("d").rmdir()
        os.chdir(before)
