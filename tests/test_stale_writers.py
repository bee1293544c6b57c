"""A process that was stopped and replaced, and wakes up: it writes nothing beside the other one."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.engine import evaluation
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import run_lock
from tests.runs import planned


def contents(folder: Path) -> dict[str, bytes]:
    """Every file there."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


class ReplacedAt:
    """Asked at every step; at one of them another process does the run from scratch, or begins."""

    def __init__(self, step: int, replace: Callable[[], object]) -> None:
        self.step, self.replace = step, replace

    def __call__(self) -> bool:
        """Never stops the training."""
        self.step -= 1
        if self.step == 0:
            self.replace()
        return False


@pytest.mark.parametrize("step", [5, 39], ids="in step {}".format)
def test_a_writer_that_was_replaced_writes_nothing_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: int
) -> None:
    """Neither a row, nor a checkpoint, nor a policy, nor a word in the record; it says why (75)."""
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
    root, after = tmp_path / "results", {}

    def replace() -> None:
        shutil.rmtree(root / "runs")
        [outcome] = train_cohort([planned()], root)
        after.update(contents(outcome.path))

    [stale] = train_cohort([planned()], root, stop=ReplacedAt(step, replace))
    assert (stale.exit_code, "another process has taken it over" in str(stale.reason)) == (75, True)
    found = contents(stale.path)
    found.pop("progress.json", None)  # shown to people only
    assert found == after


def test_an_evaluation_that_was_replaced_keeps_the_rows_of_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a drive that has no locks two may evaluate one run: the earlier writes nothing (75)."""
    monkeypatch.setattr("msgdrop_cli.records.files.take_lock", lambda _: False)
    [run] = train_cohort([planned(train_env_steps=160)], tmp_path)
    play, after = evaluation.evaluate, dict[str, bytes]()

    def replaced(path: Path, **how: Any) -> list[dict[str, Any]]:
        monkeypatch.setattr(evaluation, "evaluate", play)
        evaluation.evaluate_run(path, channel=Channel.read("half"), episodes=8)
        after.update(contents(path))
        return play(path, **how)

    monkeypatch.setattr(evaluation, "evaluate", replaced)
    with pytest.raises(RecordError, match="another process has taken it over") as caught:
        evaluation.evaluate_run(run.path, channel=Channel.read(0.5), episodes=8)
    assert caught.value.exit_code == 75
    assert contents(run.path) == after


def test_without_locks_the_later_of_two_writers_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a drive that has no locks the earlier one finds another name in the lock's file."""
    monkeypatch.setattr("msgdrop_cli.records.files.take_lock", lambda _: False)
    with run_lock(tmp_path) as first, run_lock(tmp_path) as second:
        second.check()
        with pytest.raises(RecordError, match="another process has taken it over") as caught:
            first.check()
    assert caught.value.exit_code == 75


def test_a_lock_file_that_has_gone_ends_the_epoch(tmp_path: Path) -> None:
    """Whoever deletes it lets another process in."""
    with run_lock(tmp_path) as epoch:
        epoch.check()
        (tmp_path / "lock").unlink()
        with pytest.raises(RecordError, match="taken it over"):
            epoch.check()
