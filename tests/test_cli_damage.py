"""A results folder that refuses or holds damaged files costs no number that was played for."""

import json
import shutil
from pathlib import Path

import pytest

from msgdrop_cli.records.archive import write_archive
from msgdrop_cli.records.store import list_runs
from tests.cli_runs import Store, copied_store, filled_store, msgdrop

PLAY = ("--episodes", "8", "--workers", "1")


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs, trained once; tests that change them take `copy`."""
    return filled_store(tmp_path_factory.mktemp("damage"))


@pytest.fixture
def copy(store: Store, tmp_path: Path) -> Store:
    """The same, to be changed."""
    return copied_store(store, tmp_path)


def test_numbers_come_before_figures_that_cannot_be_written(copy: Store) -> None:
    """The tables stand on stdout, as one JSON document, too; then the figures fail with 73."""
    shutil.rmtree(copy.results / "figures")
    (copy.results / "figures").touch()
    said = msgdrop("unstable-test", copy.results, *PLAY)
    assert said.code == 73
    assert "cannot be created" in said.err.splitlines()[-1]
    assert "DCC-MD 0.2" in said.out
    document = msgdrop("unstable-test", copy.results, *PLAY, "--json")
    assert document.code == 73
    assert json.loads(document.out)["results"]
    assert json.loads(document.out)["figures"] == []


def test_what_cannot_be_summarised_is_not_published(copy: Store) -> None:
    """A damaged log is found before the first run is copied."""
    log = sorted(copy.results.rglob("episodes.jsonl"))[0]
    log.write_text('{"broken_links": 0.0, "episode": 0, "steps": 3}\n')
    folder = copy.results / "published"
    said = msgdrop("publish", copy.question, "--results", copy.results, "--to", folder)
    assert (said.code, said.out) == (2, "")
    assert not list(folder.rglob("run.json"))


def test_who_is_left_out_is_counted(copy: Store) -> None:
    """A run without policy and episodes cannot be measured; a note says so, the others count."""
    policy = sorted(copy.results.rglob("policy.safetensors"))[0]
    policy.unlink()
    said = msgdrop("eval", copy.results, "--episodes", "9", "--workers", "1")
    assert said.code == 0, said.err
    left_out = "1 finished run left out: they have neither a policy nor 9 episodes of each channel"
    assert left_out in said.err.splitlines()
    assert "3 trained runs" in said.err


def test_what_is_played_anew_is_counted(copy: Store) -> None:
    """Runs with enough episodes keep theirs, which another kernel may have played."""
    for number, log in enumerate(sorted(copy.results.rglob("episodes.jsonl"))):
        if number:
            log.unlink()
    said = msgdrop("eval", copy.results, *PLAY)
    assert "3 of 4 runs lack episodes: played anew" in said.err.splitlines()
    assert "lack episodes" not in msgdrop("eval", copy.results, *PLAY).err


def test_who_hears_nobody_has_no_links_to_break(copy: Store) -> None:
    """Runs of MADDPG are left out of `unstable-test` with a note, and stay in `eval`."""
    more = ("--broken-links", "half", *PLAY)
    assert msgdrop("eval", copy.results, *more).code == 0
    for record in sorted(copy.results.rglob("run.json"))[:2]:
        run = json.loads(record.read_text())
        run["spec"]["algorithm"]["learner"] = "maddpg"
        record.write_text(json.dumps(run))
    assert "left out" not in msgdrop("eval", copy.results, *more).err
    said = msgdrop("unstable-test", copy.results, *PLAY)
    assert said.code == 0, said.err
    note = "2 finished runs left out: they hear nobody, so no link can break"
    assert note in said.err.splitlines()
    assert "2 trained runs" in said.err


def test_what_a_kill_left_of_a_finished_run_goes_at_the_next_start(copy: Store) -> None:
    """The same command finds nothing to train, and tidies up; a dry run changes nothing."""
    run = next(copy.results.rglob("run.json")).parent
    (run / "checkpoints" / f"{160:015d}").mkdir(parents=True)
    (run / ".tmp-1").write_text("half")
    assert copy.ablate("--dry-run").code == 0
    assert (run / "checkpoints").exists()
    assert copy.ablate().code == 0
    assert not (run / "checkpoints").exists()
    assert not (run / ".tmp-1").exists()


def test_nothing_is_imported_through_a_link(store: Store, tmp_path: Path) -> None:
    """In a results folder from somebody else the folder of the runs may lead anywhere."""
    write_archive(tmp_path / "a.zip", list_runs(store.results / "runs"))
    (tmp_path / "outside").mkdir()
    (tmp_path / "new").mkdir()
    link = tmp_path / "new" / "runs"
    link.symlink_to(tmp_path / "outside")
    said = msgdrop("import", tmp_path / "a.zip", "--results", tmp_path / "new")
    assert f"{link}: is a symbolic link" in said.err
    assert said.code == 73
    assert not any((tmp_path / "outside").iterdir())
