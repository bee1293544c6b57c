"""What becomes of the copies that are there when a study is published once more."""

import shutil
from pathlib import Path

from msgdrop_cli.records.store import list_runs
from tests.cli_runs import Said, filled_store, msgdrop


def publish(folder: Path) -> Said:
    """Publish the question of `filled_store`."""
    where = ("--results", folder / "results", "--to", folder / "results" / "published")
    return msgdrop("publish", folder / "tiny.toml", *where)


def test_who_evaluates_own_runs_is_told_of_published_ones(tmp_path: Path) -> None:
    """Of those that are no copies of the own ones."""
    filled_store(tmp_path)
    assert publish(tmp_path).code == 0
    results = tmp_path / "results"
    said = msgdrop("eval", results, "--episodes", "2", "--workers", "1")
    assert "published" not in said.err
    shutil.rmtree(next((results / "runs").rglob("dcc-s1-*")))
    said = msgdrop("eval", results, "--episodes", "2", "--workers", "1")
    assert "1 finished run left out: they are published, and there are your own" in said.err


def test_a_copy_that_says_the_same_stays_as_it_is(tmp_path: Path) -> None:
    """Without a policy where space was dear, with the only one there is; any other is replaced."""
    filled_store(tmp_path)
    assert publish(tmp_path).code == 0
    copies = list_runs(tmp_path / "results" / "published")
    assert [(run.variant, run.seed) for run in copies] == [
        *(("dcc", 1), ("dcc", 2), ("md-0.2", 1), ("md-0.2", 2))
    ]
    bare, changed, kept, second = (run.path for run in copies)
    policy, log = "policy.safetensors", "episodes.jsonl.gz"
    lost, whole = (kept / policy).read_bytes(), (changed / log).read_bytes()
    own = next((tmp_path / "results" / "runs").rglob(kept.name)) / policy
    (bare / policy).unlink()
    own.unlink()
    (second / policy).write_bytes(b"nobody publishes it of a second seed")
    (changed / log).write_bytes((bare / log).read_bytes())
    assert publish(tmp_path).code == 0
    assert not (bare / policy).exists()
    assert (kept / policy).read_bytes() == lost
    assert not (second / policy).exists()
    assert (changed / log).read_bytes() == whole
    own.write_bytes(b"what was trained")
    (changed / log).write_bytes(whole[:40])
    assert publish(tmp_path).code == 0
    assert (kept / policy).read_bytes() == b"what was trained"
    assert (changed / log).read_bytes() == whole
