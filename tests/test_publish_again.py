"""What becomes of the copies that are there when a study is published once more."""

import os
import shutil
from pathlib import Path

import pytest

from msgdrop_cli.records.store import list_runs
from tests.cli_runs import QUESTION, Said, filled_store, msgdrop


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


def test_no_poorer_run_takes_the_place_of_what_is_published(tmp_path: Path) -> None:
    """Neither training that is not evaluated yet, nor a run with fewer episodes."""
    filled_store(tmp_path)
    results = tmp_path / "results"
    own = sorted(results.glob("runs/*/*"))
    rows = (own[0] / "episodes.jsonl").read_text().splitlines(keepends=True)
    (own[3] / "episodes.jsonl").unlink()
    said = publish(tmp_path)
    assert said.code == 0
    assert "passed over: 1 run of yours, not evaluated yet" in said.err
    copies = list_runs(results / "published")
    assert [run.path.name for run in copies] == [path.name for path in own[:3]]
    (own[0] / "episodes.jsonl").write_text("".join(rows[:-1]))
    (own[1] / "episodes.jsonl").unlink()
    before = {run.run_id: run.episodes() for run in copies}
    said = publish(tmp_path)
    assert "passed over: 3 runs of yours" in said.err
    assert {run.run_id: run.episodes() for run in list_runs(results / "published")} == before
    assert msgdrop("verify", results / "published").code == 0


def test_a_kept_policy_outlives_the_runs_own(tmp_path: Path) -> None:
    """Also where the copy is made anew, with more episodes of the same training."""
    filled_store(tmp_path)
    results = tmp_path / "results"
    [own] = results.glob("runs/*/dcc-s1-*")
    assert publish(tmp_path).code == 0
    weights = (own / "policy.safetensors").read_bytes()
    assert msgdrop("eval", own, "--episodes", "12", "--workers", "1").code == 0
    (own / "policy.safetensors").unlink()
    assert publish(tmp_path).code == 0
    [copy] = results.glob("published/*/*/dcc-s1-*")
    assert {len(rows) for rows in list_runs(copy)[0].episodes().values()} >= {12}
    assert (copy / "policy.safetensors").read_bytes() == weights


@pytest.mark.parametrize("kind", ["link", "pipe"])
def test_a_policy_that_is_no_file_is_refused(tmp_path: Path, kind: str) -> None:
    """What it leads to is not published, and nobody waits for who writes into it."""
    filled_store(tmp_path)
    [own] = (tmp_path / "results").glob("runs/*/dcc-s1-*")
    policy, secret = own / "policy.safetensors", tmp_path / "secret"
    secret.write_text("my private key")
    for again in (False, True):
        policy.unlink()
        policy.symlink_to(secret) if kind == "link" else os.mkfifo(policy)
        said = publish(tmp_path)
        assert said.code == 2
        assert str(policy) in said.err
        assert not any(
            path.read_bytes() == secret.read_bytes()
            for path in (tmp_path / "results" / "published").rglob("*.safetensors")
        )
        if not again:
            policy.unlink()
            policy.write_bytes(b"weights")
            assert publish(tmp_path).code == 0


def test_a_torn_log_takes_no_place(tmp_path: Path) -> None:
    """Half of a training is no run: its file is named, and the copy stays as it is."""
    filled_store(tmp_path)
    assert publish(tmp_path).code == 0
    published = tmp_path / "results" / "published"
    before = {path: path.read_bytes() for path in published.rglob("*") if path.is_file()}
    log = next((tmp_path / "results" / "runs").rglob("dcc-s2-*")) / "metrics.jsonl"
    log.write_text(log.read_text().splitlines(keepends=True)[0])
    said = publish(tmp_path)
    assert (said.code, f"{log}: does not end with env_steps" in said.err) == (2, True), said.err
    assert {path: path.read_bytes() for path in published.rglob("*") if path.is_file()} == before


def test_no_study_of_a_shipped_question_is_written_over(tmp_path: Path) -> None:
    """By a question of one's own that is called like it."""
    own = tmp_path / "navigation.toml"
    own.write_text(QUESTION)
    to = tmp_path / "published"
    said = msgdrop("publish", own, "--results", tmp_path / "results", "--to", to)
    assert said.code == 2
    assert f"{own}: a question that is shipped is called navigation" in said.err
    assert not to.exists()


def test_a_reading_of_evaluations_is_no_other_run(tmp_path: Path) -> None:
    """So there is nothing to publish under its name, and claims would be about something else."""
    said = msgdrop("publish", "dropout-rate", "--reading", "exploring", "--results", tmp_path)
    assert (said.code, "--reading exploring: it changes no run" in said.err) == (2, True)
