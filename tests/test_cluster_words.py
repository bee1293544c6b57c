"""What a command and the workers of a cluster say to each other, without a cluster."""

import os
import pickle
import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from msgdrop_cli.cluster import guests, tasks
from msgdrop_cli.cluster.apart import _Apart, _Away
from msgdrop_cli.cluster.connection import PATIENCE_S, check_cluster
from msgdrop_cli.cluster.control import SharedControl, shared_control
from msgdrop_cli.cluster.parcels import parcel
from msgdrop_cli.cluster.shared import work_there
from msgdrop_cli.commands.parts import carry_out
from msgdrop_cli.errors import DefinitionError, RecordError, RunError
from msgdrop_cli.records.files import run_lock
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.planned import plan_run
from msgdrop_cli.records.store import list_runs, run_path, set_status
from msgdrop_cli.scheduler import Task
from msgdrop_cli.stopping import in_memory
from tests.cli_runs import msgdrop
from tests.processes import tasks_for, tiny_runs

pytest.importorskip("distributed")
TASK: Any = SimpleNamespace(run_ids=("aaaaaaaa",))


def test_clocks_of_two_machines_need_not_begin_together(tmp_path: Path) -> None:
    """One that has been up for a day longer than ours has not waited for a day."""
    with shared_control(tmp_path) as ours:
        assert not ours.stopping()  # it has been read here, at a time of this machine's
        theirs = pickle.loads(pickle.dumps(ours))
        with pytest.MonkeyPatch.context() as patch:
            later = time.monotonic() + 86_400.0
            patch.setattr(time, "monotonic", lambda: later)
            assert ours.stopping()
            assert not theirs.stopping()


def test_a_line_that_a_network_drive_has_lost_is_no_bug(tmp_path: Path) -> None:
    """Two machines wrote at one place: what is left of a line says nothing, the others do."""
    (tmp_path / "control").write_text("000000001\naaaaaaaa training\nining\n\nbbbbbbbb writing\n")
    said = SharedControl(tmp_path / "control", -1).phases()
    assert said == {"aaaaaaaa": "training", "bbbbbbbb": "writing"}


def test_nobody_waits_for_what_has_come(tmp_path: Path) -> None:
    """A run that wrote and came home writes no more; one that is still away does."""
    with in_memory() as control:
        way = _Apart(SimpleNamespace(), control)  # type: ignore[arg-type]
        way.away[TASK.run_ids] = _Away(folders={"aaaaaaaa": tmp_path})
        way._show({"aaaaaaaa": "writing"}, {})
        assert control.writing()
        way.abandon(TASK)
        assert not control.writing()


@pytest.mark.parametrize(
    ("status", "said"), [("interrupted", {"aaaaaaaa": "writing"}), ("done", {})]
)
def test_a_checkpoint_on_its_way_is_waited_for(
    status: Any, said: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Until it is home, whoever asks hears that its run writes."""
    worker: Any = SimpleNamespace(local_directory=tmp_path)
    outcome = Outcome(run_id="aaaaaaaa", path=tmp_path, status=status)
    monkeypatch.setattr("distributed.get_worker", lambda: worker)
    monkeypatch.setattr(guests, "work_there", lambda task, control: [outcome])
    [task] = tasks_for(tiny_runs(seeds=(1,)), tmp_path)
    monkeypatch.setattr(Task, "folders", {"aaaaaaaa": tmp_path / "empty"})
    guests.work_apart(task, {}, "session")
    assert guests.hear("session", "000000001\n", worker) == (said, {})


def test_a_drive_that_fails_ends_only_its_run(tmp_path: Path) -> None:
    """What cannot be removed there stays; what cannot be read is a line that names it."""
    with in_memory() as control, pytest.MonkeyPatch.context() as patch:
        way = _Apart(SimpleNamespace(), control)  # type: ignore[arg-type]
        way.away[TASK.run_ids] = _Away(folders={"aaaaaaaa": tmp_path})
        (tmp_path / "run.json").write_text("{}")

        def fails(*_: Any, **__: Any) -> bytes:
            raise OSError(5, "Input/output error")

        patch.setattr(Path, "unlink", fails)
        patch.setattr(Path, "read_bytes", fails)
        way.abandon(TASK)
        with pytest.raises(RecordError, match=r"run\.json: cannot be read: Input") as caught:
            parcel(tmp_path)
    assert caught.value.exit_code == 74


def test_a_scheduler_that_is_silent_is_not_waited_for() -> None:
    """It was stopped: the connection stands, and nothing is ever answered."""
    crew = tasks._Crew(SimpleNamespace(status="running"), ("tcp://1",), Future())  # type: ignore[arg-type]
    crew.look()
    assert crew.lost() == ""
    crew.seen -= PATIENCE_S + 1.0
    crew.look()
    assert crew.lost() == tasks.SILENT


def test_who_is_there_is_asked_before_anything_is_sent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Gigabytes may take longer than the patience: what was answered meanwhile is an answer."""
    order: list[str] = []
    client: Any = SimpleNamespace(status="running", nthreads=lambda: {"tcp://1": 1})
    monkeypatch.setattr(tasks, "asked", lambda *_: order.append("asked"))

    def submit(task: Task) -> None:
        order.append("sent")
        raise RecordError("is in use by another process", 75)

    way: Any = SimpleNamespace(submit=submit)
    with in_memory() as control:
        todo = tasks_for(tiny_runs(seeds=(1,)), tmp_path)
        tasks.carry(client, way, todo, control, lambda news: order.append(news[0].status))
    assert order == ["asked", "sent", "failed"]


def test_a_worker_that_does_not_see_the_folder_makes_none(tmp_path: Path) -> None:
    """It came late: its task has failed, with a line, and nothing is left on its disk."""
    [task] = tasks_for(tiny_runs(seeds=(1,)), tmp_path / "elsewhere")
    with in_memory() as control, pytest.raises(RunError, match=r"does not see .*elsewhere; end"):
        work_there(task, control)
    assert not list(tmp_path.iterdir())


def test_the_machine_is_noted_where_the_run_lies(tmp_path: Path) -> None:
    """Another question named it first: no second folder is made under the new name."""
    [run] = tiny_runs(seeds=(1,))
    [task] = tasks_for([run], tmp_path)
    lies = run_path(tmp_path, run).with_name(f"another-name-s1-{run.run_id}")
    plan_run(lies, run)
    with run_lock(lies):
        set_status(lies, "failed", "as an example")
    with in_memory() as control, pytest.MonkeyPatch.context() as patch:
        patch.setattr("msgdrop_cli.cluster.shared.work", lambda task, control: [])
        work_there(task, control)
    [record] = list_runs(tmp_path)
    assert record.path == lies
    assert record.run["node"] == os.uname().nodename


@pytest.mark.parametrize("where", ["local:²", "local:0", "local:" + "9" * 5000, "dask://a:²"])
def test_what_python_calls_a_digit_is_no_number(where: str) -> None:
    """They are refused in a line."""
    with pytest.raises(DefinitionError, match=r"^--cluster: .* is none; expected"):
        check_cluster(where)


def test_work_that_stops_unasked_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers that hear nothing write their checkpoints, and the command ends with why."""
    heard = "msgdrop_cli.cluster.control.SharedControl.stopping"
    monkeypatch.setattr(heard, lambda control: True)

    @contextmanager
    def silent() -> Iterator[SharedControl]:
        yield SharedControl(tmp_path / "control", -1)

    monkeypatch.setattr(carry_out, "in_memory", silent)
    (tmp_path / "control").touch()
    said = msgdrop("train", "--env", "pursuit-n6", "--results", tmp_path / "results")
    assert said.code == 1
    assert "msgdrop: error: 1 run stopped, and nobody here asked for it: " in said.err
