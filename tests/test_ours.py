"""A results folder from somebody else: nothing outside it is touched, nor what is not ours."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from msgdrop_cli.engine import run as engine
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import run_lock
from msgdrop_cli.records.ours import delete_leftovers, refuse_links
from msgdrop_cli.records.store import RunRecord
from tests.fake_runs import write_run
from tests.runs import StopAt, planned

RUN = planned(train_env_steps=240, checkpoint_every_env_steps=80)
FOREIGN = ("thesis.tex", "2024/photo.jpg", "000000000000160.txt", "replay/notes", "tmp-1")


def fill(folder: Path) -> dict[Path, bytes]:
    """Somebody's files, some with names that begin like ours."""
    for name in FOREIGN:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("mine")
    return content(folder)


def content(folder: Path) -> dict[Path, bytes]:
    """Every file in a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a run that was stopped after two checkpoints."""
    monkeypatch.setattr(engine, "_LOOK_UP_EVERY_S", 0.0)
    [outcome] = train_cohort([RUN], tmp_path / "results", stop=StopAt(22))
    return outcome.path


PLACES: dict[str, Callable[[Path], Path]] = {
    "replay": lambda run: run / "checkpoints" / "replay",
    "checkpoints": lambda run: run / "checkpoints",
    "run": lambda run: run,
    "environment": lambda run: run.parent,
    "runs": lambda run: run.parents[1],
}


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_no_link_is_followed_out_of_the_results(
    place: Callable[[Path], Path], stopped: Path, tmp_path: Path
) -> None:
    """Nothing behind it is read for a start, deleted or written, and what to do is said."""
    linked, outside = place(stopped), tmp_path / "outside"
    shutil.copytree(linked, outside)  # checkpoints that verify lead nowhere, either
    shutil.rmtree(linked)
    before = fill(outside)
    linked.symlink_to(outside)
    with pytest.raises(RecordError, match=f"{linked}: is a symbolic link"):
        train_cohort([RUN], tmp_path / "results")
    assert content(outside) == before


def test_a_link_with_the_name_of_a_checkpoint_is_itself_deleted(
    stopped: Path, tmp_path: Path
) -> None:
    """And so is one with the name of a segment; where they lead, nothing changes."""
    before = fill(tmp_path / "outside")
    checkpoints = stopped / "checkpoints"
    links = (
        checkpoints / f"{0:015d}",
        checkpoints / ".tmp-1",
        checkpoints / "replay" / f"{0:015d}-{1:015d}.safetensors",
    )
    for link in links:
        link.symlink_to(tmp_path / "outside")
    [outcome] = train_cohort([RUN], tmp_path / "results")
    assert (outcome.status, outcome.reason) == ("done", None)
    assert not any(link.is_symlink() for link in links)
    assert content(tmp_path / "outside") == before


def test_only_names_that_are_ours_are_deleted(stopped: Path, tmp_path: Path) -> None:
    """What somebody keeps among the checkpoints outlives them all."""
    before = fill(stopped / "checkpoints")
    train_cohort([RUN], tmp_path / "results")
    left = content(stopped / "checkpoints")
    assert left == {path: text for path, text in before.items() if text == b"mine"}
    assert len(left) == len(FOREIGN)


def test_what_the_user_named_may_be_a_link(stopped: Path, tmp_path: Path) -> None:
    """`--results` is where they want it; only what lies in it is distrusted."""
    (tmp_path / "link").symlink_to(tmp_path / "results")
    [outcome] = train_cohort([RUN], tmp_path / "link")
    assert (outcome.status, outcome.reason) == ("done", None)
    refuse_links(tmp_path / "link", tmp_path / "link")


def leave(path: Path) -> None:
    """What a kill leaves of a run: a checkpoint, and what was being written."""
    (path / "checkpoints" / f"{160:015d}").mkdir(parents=True)
    (path / "checkpoints" / f"{160:015d}" / "MANIFEST.json").write_text("{}")
    (path / "checkpoints" / "replay").mkdir()
    for name in (".tmp-1", "progress.json", f"checkpoints/replay/{0:015d}-{1:015d}.safetensors"):
        (path / name).write_text("{}")


def files(record: RunRecord) -> list[str]:
    """What lies in the folder of a run."""
    return sorted(path.name for path in record.path.iterdir())


def test_leftovers_of_finished_runs_are_deleted(tmp_path: Path) -> None:
    """Those that go on keep theirs, and a clean folder is not even locked: it may be read-only."""
    killed = write_run(tmp_path, "dcc", 1)
    clean, stopped = write_run(tmp_path, "dcc", 2), write_run(tmp_path, "dcc", 3, status="failed")
    before = files(clean)
    for record in (killed, stopped):
        leave(record.path)
    delete_leftovers([killed, clean, stopped])
    assert files(killed) == sorted([*before, "lock"])
    assert files(clean) == before
    assert files(stopped) == sorted([*before, ".tmp-1", "checkpoints", "progress.json"])


def test_leftovers_of_a_run_at_work_are_left(tmp_path: Path) -> None:
    """Another runner may just be evaluating it, or deleting them itself."""
    record = write_run(tmp_path, "dcc", 1)
    leave(record.path)
    with run_lock(record.path):  # deletes what was being written when it is taken
        (record.path / ".tmp-2").write_text("half")
        before = files(record)
        delete_leftovers([record])
        assert files(record) == before
