"""Two runners on one results folder: what was true before the lock is looked at again under it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine import opening
from msgdrop_cli.engine import run as engine
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import Epoch, run_lock
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.store import RunRecord, list_runs, run_path
from tests.runs import StopAt, planned

RUN = planned(train_env_steps=120)


def meanwhile(monkeypatch: pytest.MonkeyPatch, happens: Callable[[], object]) -> None:
    """Something happens between the first look at a run and its lock."""

    @contextmanager
    def late_lock(path: Path) -> Iterator[Epoch]:
        monkeypatch.setattr(opening, "run_lock", run_lock)
        happens()
        with run_lock(path) as epoch:
            yield epoch

    monkeypatch.setattr(opening, "run_lock", late_lock)


@pytest.mark.parametrize(
    "other",
    [RUN, replace(RUN, variant="another-arm")],
    ids=["the same question", "another question, which has its folder elsewhere"],
)
def test_a_run_that_another_runner_ends_meanwhile_is_done(
    other: PlannedRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is not trained again from 0, and its record stays as it was."""
    ended: list[Outcome] = []
    records: list[RunRecord] = []

    def end_it() -> None:
        ended.extend(train_cohort([other], tmp_path))
        records.extend(list_runs(tmp_path))
        monkeypatch.setattr(engine, "Training", lambda *_: pytest.fail("trained again"))

    meanwhile(monkeypatch, end_it)
    assert train_cohort([RUN], tmp_path) == ended
    assert list_runs(tmp_path) == records
    assert len(records) == 1


def test_a_run_that_another_runner_begins_meanwhile_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It goes on where the other one has left it, in the folder where that is."""
    monkeypatch.setattr(engine, "_LOOK_UP_EVERY_S", 0.0)
    other = replace(RUN, variant="another-arm")
    meanwhile(monkeypatch, lambda: train_cohort([other], tmp_path, stop=StopAt(4)))
    [outcome] = train_cohort([RUN], tmp_path)
    assert (outcome.status, outcome.reason) == ("done", None)
    assert [record.path for record in list_runs(tmp_path)] == [outcome.path]
    assert "another-arm" in outcome.path.name


def test_a_run_that_another_runner_trains_is_busy(tmp_path: Path) -> None:
    """One writer a run."""
    with run_lock(run_path(tmp_path, RUN)), pytest.raises(RecordError) as caught:
        train_cohort([RUN], tmp_path)
    assert caught.value.exit_code == 75
