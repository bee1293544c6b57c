"""What becomes of runs that a cluster's workers have done, without a cluster."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from msgdrop_cli.cluster import apart, parcels
from msgdrop_cli.cluster.shared import work_there
from msgdrop_cli.definition.channel import NONE_BROKEN
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import run_lock, write_bytes_atomic
from msgdrop_cli.records.own_sums import RUN_SUMS, run_differences
from msgdrop_cli.records.store import POLICY, RUN, list_runs
from msgdrop_cli.scheduler import Task
from tests.runs import planned

CONTROL: Any = SimpleNamespace(stopping=lambda: False, mark=lambda *_: None, phases=dict)


@pytest.fixture
def done(tmp_path: Path) -> Path:
    """The folder of a finished run."""
    [outcome] = train_cohort([planned()], tmp_path / "results")
    return outcome.path


def _task(run: Path, **settings: Any) -> Task:
    given = {"channels": (NONE_BROKEN,), "episodes": 2, "device": "cpu", **settings}
    return Task(root=run.parents[2], **given)


def test_a_training_stays_finished_if_its_evaluation_fails(done: Path) -> None:
    """The record is of the training; the policy cannot be read any more."""
    (done / POLICY).write_bytes(b"damaged")
    [outcome] = work_there(_task(done, train=(planned(),)), CONTROL)
    [record] = list_runs(done)
    assert outcome.status == "failed"
    assert record.status == "done"
    assert (done / RUN_SUMS).exists()


def test_what_is_no_file_of_a_run_stays(done: Path) -> None:
    """Somebody's notes are not sent, and so nobody has to refuse them."""
    (done / "my notes.txt").write_text("mine")
    (done / "derived").mkdir()
    (done / "derived" / "x.json").write_text("{}")
    assert {name.split("/")[0] for name in parcels.parcel(done)} == {
        path.name for path in done.iterdir() if path.name not in ("lock", "my notes.txt", "derived")
    }


def test_a_kill_between_two_files_leaves_no_list_that_denies_them(
    done: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The list of digests goes first and comes last."""
    came = {**parcels.parcel(done), RUN: b'{"of another": "time"}'}

    def killed(path: Path, content: bytes) -> None:
        if path.name == RUN_SUMS:
            raise KeyboardInterrupt
        write_bytes_atomic(path, content)

    monkeypatch.setattr(parcels, "write_bytes_atomic", killed)
    with pytest.raises(KeyboardInterrupt):
        parcels.open_parcel(came, done)
    assert (done / RUN).read_bytes() == came[RUN]
    assert not (done / RUN_SUMS).exists()


def test_a_run_that_was_finished_meanwhile_is_locked_while_it_is_away(done: Path) -> None:
    """Or what another process writes now would be written over by what comes back."""
    client: Any = SimpleNamespace(submit=lambda *_, **__: None, status="closed")
    task = _task(done, train=(planned(),))
    way = apart._Apart(client, CONTROL)
    way.submit(task)
    with pytest.raises(RecordError, match="in use by another process"), run_lock(done):
        pass
    way.abandon(task)
    with run_lock(done):
        assert run_differences(done) == []


def test_what_cannot_be_opened_is_in_the_record_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker's answer that this machine cannot write down: the run has failed, not `running`."""
    client: Any = SimpleNamespace(submit=lambda *_, **__: None, status="closed")
    run = planned()
    task = Task(root=tmp_path, train=(run,), channels=(), episodes=1, device="cpu")
    way = apart._Apart(client, CONTROL)
    way.submit(task)
    folder = task.folders[run.run_id]
    [outcome] = train_cohort([run], tmp_path / "there")
    monkeypatch.setattr(
        apart, "open_parcel", lambda *_: (_ for _ in ()).throw(RecordError("no room", 74))
    )
    (folder / RUN).write_bytes((outcome.path / RUN).read_bytes().replace(b'"done"', b'"running"'))
    [found] = way.receive(task, [(outcome, {})])
    assert (found.status, found.exit_code) == ("failed", 74)
    assert [record.status for record in list_runs(folder)] == ["failed"]
