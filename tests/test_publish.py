"""Publishing: small copies of finished runs, and nothing else."""

import gzip
import shutil
from contextlib import ExitStack
from pathlib import Path

import pytest

from msgdrop_cli.commands.parts.play_missing import _copy
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.store import list_runs
from msgdrop_cli.records.sums import list_sums
from msgdrop_cli.report.study import publish
from msgdrop_cli.report.write import Folder
from tests.cli_runs import msgdrop
from tests.fake_runs import write_run

PUBLISHED = Path(__file__).parents[1] / "results" / "published"


def test_numbers_of_all_and_one_policy_of_each_variant(tmp_path: Path) -> None:
    """Every seed's records are copied; only the lowest seed's policy goes along."""
    records = [write_run(tmp_path / "ours", v, s) for v in ("dcc", "md-0.2") for s in (2, 1)]
    for record in records:
        (record.path / "policy.safetensors").write_bytes(b"weights")
        (record.path / "lock").touch()
    copies = publish(records, Folder(tmp_path / "published"))
    assert [r.run_id for r in list_runs(tmp_path / "published")] == sorted(
        (r.run_id for r in records),
        key=lambda run_id: next(str(r.path.name) for r in records if r.run_id == run_id),
    )
    with_policy = [path.name for path in copies if (path / "policy.safetensors").exists()]
    assert [name.split("-s")[1][0] for name in with_policy] == ["1", "1"]
    assert not list((tmp_path / "published").rglob("lock"))
    assert not list((tmp_path / "published").rglob(".tmp-*"))


def test_publishing_again_replaces(tmp_path: Path) -> None:
    """An older copy of the same run is gone as a whole."""
    record = write_run(tmp_path / "ours", "dcc", 1)
    [copy] = publish([record], Folder(tmp_path / "published"))
    (copy / "stale").touch()
    assert publish([record], Folder(tmp_path / "published")) == [copy]
    assert sorted(p.name for p in copy.iterdir()) == [
        *("episodes.jsonl.gz", "metrics.jsonl.gz", "run.json")
    ]


def test_a_packed_copy_says_the_same(tmp_path: Path) -> None:
    """Windows and episodes of a published run are those of the run."""
    record = write_run(tmp_path / "ours", "dcc", 1, catches={0.0: 3})
    [copy] = list_runs(publish([record], Folder(tmp_path / "published"))[0])
    assert len(record.metrics()) > 0 < len(record.episodes())
    assert (copy.metrics(), copy.episodes()) == (record.metrics(), record.episodes())


def test_what_is_published_can_be_published_again(tmp_path: Path) -> None:
    """Even onto itself: its packed logs stay as they are."""
    first = publish([write_run(tmp_path / "ours", "dcc", 1)], Folder(tmp_path / "published"))[0]
    logs = [first / f"{name}.jsonl.gz" for name in ("metrics", "episodes")]
    before = [log.read_bytes() for log in logs]
    assert publish(list_runs(first), Folder(tmp_path / "published")) == [first]
    assert [log.read_bytes() for log in logs] == before


def test_a_bad_row_names_the_file_that_is_there(tmp_path: Path) -> None:
    """A packed log is called by its own name."""
    [copy] = publish([write_run(tmp_path / "ours", "dcc", 1)], Folder(tmp_path / "published"))
    (copy / "episodes.jsonl.gz").write_bytes(gzip.compress(b"{}\n"))
    with pytest.raises(RecordError, match=r"episodes\.jsonl\.gz: line 1"):
        list_runs(copy)[0].episodes()


def test_what_is_played_anew_keeps_its_packed_logs(tmp_path: Path) -> None:
    """The copy in which a published run is evaluated further has its windows and episodes."""
    [record] = list_runs(publish([write_run(tmp_path / "o", "dcc", 1)], Folder(tmp_path / "p"))[0])
    with ExitStack() as keep:
        copy = _copy(record, keep)
        assert copy.path != record.path
        assert (copy.metrics(), copy.episodes()) == (record.metrics(), record.episodes())


def test_what_is_published_needs_no_own_runs_to_be_published_again(tmp_path: Path) -> None:
    """Page, figures and list are made anew of the runs that lie there, which keep their bytes."""
    study = tmp_path / "waterworld-half-million"
    shutil.copytree(PUBLISHED / study.name, study)
    before = {path: path.read_bytes() for path in study.rglob("*") if path.is_file()}
    (study / "TABLES.md").unlink()
    (study / "figures" / "old.png").write_bytes(b"of a variant that is gone")
    list_sums(study)
    (study / "figures" / "mine.png").write_bytes(b"never published")
    options = ("--profile", "half-million", "--results", tmp_path / "none", "--to", tmp_path)
    said = msgdrop("publish", "waterworld", *options)
    assert said.code == 0, said.err
    assert not (study / "figures" / "old.png").exists()
    (study / "figures" / "mine.png").unlink()
    list_sums(study)
    assert {path: path.read_bytes() for path in study.rglob("*") if path.is_file()} == before


def test_new_runs_join_those_that_are_published(tmp_path: Path) -> None:
    """Of both is the page; a policy goes along for the lowest seed of all of them."""
    folder = Folder(tmp_path / "published")
    publish([write_run(tmp_path / "a", "dcc", 1)], folder)
    newer = write_run(tmp_path / "b", "dcc", 2)
    (newer.path / "policy.safetensors").write_bytes(b"weights")
    copies = publish([newer, *list_runs(folder.root)], folder)
    assert len(copies) == len(set(copies)) == 2
    assert not list(folder.root.rglob("policy.safetensors"))
