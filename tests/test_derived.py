"""What is kept of runs' logs gives the same numbers, and is never worth more than the logs."""

import json
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import msgdrop_cli
from msgdrop_cli.analysis import curves
from msgdrop_cli.analysis.curves import learning_curve, learning_mean
from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.commands.parts.answers import readable_runs
from msgdrop_cli.commands.parts.listing import runs_in
from msgdrop_cli.commands.parts.verified import verified
from msgdrop_cli.definition.channel import NONE_BROKEN
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records import derived
from msgdrop_cli.records.counted import _rank
from msgdrop_cli.records.derived import DERIVED
from msgdrop_cli.records.files import read_bytes
from msgdrop_cli.records.packed import read_log
from msgdrop_cli.records.remembering import remembering
from msgdrop_cli.records.sources import code, code_files
from msgdrop_cli.records.store import EPISODES, METRICS, RUNS, RunRecord, list_runs
from msgdrop_cli.records.sums import list_sums
from tests.fake_runs import write_run

METRIC = "catches_per_500"
CURVE = (1.0 / 3.0, 0.1, None, 2.7)


@pytest.fixture(autouse=True)
def _settled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Logs of just now are relied on, as those of hours ago are."""
    monkeypatch.setattr(derived, "SETTLED_NS", 0)


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A results folder with two finished runs."""
    for seed in (1, 2):
        write_run(tmp_path, "dcc", seed, catches={0.0: 3 + seed, 0.5: 1}, curve=CURVE)
    return tmp_path


def records(home: Path) -> list[RunRecord]:
    """The runs, as they are read by who keeps what was computed."""
    return remembering(list_runs(home), home)


def numbers(runs: Sequence[RunRecord]) -> tuple[Any, ...]:
    """Everything that is kept, and what is made of it, to the last bit."""
    means = [learning_mean(run, METRIC) for run in runs]
    return summarise(runs).to_json(), repr(learning_curve(runs, METRIC)), repr(means)


def no_log(*_: Any) -> Any:
    """A log that nobody may read."""
    raise AssertionError("a log was read")


def test_numbers_are_the_same_without_with_and_from_what_is_kept(home: Path) -> None:
    """Bit for bit."""
    without = numbers(list_runs(home))
    assert numbers(records(home)) == without
    assert numbers(records(home)) == without


def test_logs_are_read_once(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second time no log is opened at all."""
    first = numbers(records(home))
    monkeypatch.setattr("msgdrop_cli.records.store.read_log", no_log)
    assert numbers(records(home)) == first


def test_a_log_is_read_once(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first time, too: what is computed of it is computed together."""
    read: list[Path] = []

    def noted(path: Path, *numbers: str) -> list[dict[str, Any]]:
        read.append(path)
        return read_log(path, *numbers)

    monkeypatch.setattr("msgdrop_cli.records.store.read_log", noted)
    runs = records(home)
    numbers(runs)
    assert all(run.has_episodes([NONE_BROKEN], 2) for run in runs)
    assert sorted(read) == sorted(run.path / log for run in runs for log in (METRICS, EPISODES))


def test_one_file_is_read_for_each_run(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many numbers are asked for."""
    numbers(records(home))
    opened: list[Path] = []

    def noted(path: Path, most: int) -> bytes:
        opened.append(path)
        return read_bytes(path, most)

    monkeypatch.setattr(derived, "read_bytes", noted)
    numbers(records(home))
    assert sorted(opened) == sorted((home / DERIVED).iterdir())
    assert len(opened) == 2


@pytest.mark.parametrize("log", [METRICS, EPISODES])
def test_a_changed_log_is_read_again(home: Path, log: str) -> None:
    """Also one that is as long, and says that it is as old."""
    before = numbers(records(home))
    path = list_runs(home)[0].path / log
    times = path.stat()
    changed = path.read_text().replace('"catches": 4', '"catches": 9').replace("0.1", "0.2")
    path.write_text(changed)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert path.stat().st_size == times.st_size
    assert numbers(records(home)) == numbers(list_runs(home)) != before


@pytest.mark.parametrize("damage", [b"", b"\xff" * 9, b"{}", b"digest\n[[], {}]"])
def test_damage_is_made_anew(home: Path, damage: bytes) -> None:
    """Silently."""
    right = numbers(records(home))
    files = sorted((home / DERIVED).iterdir())
    sound = [file.read_bytes() for file in files]
    files[0].write_bytes(damage)
    assert numbers(records(home)) == right
    assert [file.read_bytes() for file in files] == sound


def test_a_changed_digit_is_damage(home: Path) -> None:
    """What is kept is sealed."""
    right = numbers(records(home))
    for file in (home / DERIVED).iterdir():
        file.write_bytes(file.read_bytes().replace(b"2.7", b"3.7"))
    assert numbers(records(home)) == right


def test_other_code_makes_its_own_numbers(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What another version has kept does not count."""
    numbers(records(home))
    monkeypatch.setattr(derived, "code", lambda: "another")
    monkeypatch.setattr(curves, "_learning_mean", lambda windows: 42.0)
    assert [learning_mean(run, METRIC) for run in records(home)] == [42.0, 42.0]


def test_other_code_counts_its_own_episodes(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether a run has its evaluation depends on how its rows are read, too."""
    assert all(run.has_episodes([NONE_BROKEN], 2) for run in records(home))
    monkeypatch.setattr(derived, "code", lambda: "another")
    monkeypatch.setattr("msgdrop_cli.records.store.by_channel", lambda rows, file: {})
    assert not any(run.has_episodes([NONE_BROKEN], 1) for run in records(home))


def test_what_an_entry_means_is_part_of_the_code() -> None:
    """As are reading and adding."""
    names = {f"{file.parent.name}/{file.name}" for file in code_files()}
    assert names >= {"definition/channel.py", "records/packed.py", "analysis/metrics.py"}
    assert "msgdrop_envs/metric.py" in names


def test_what_other_code_has_kept_makes_room(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However often the program changes, a file holds what one of them computed."""
    numbers(records(home))
    sizes = {file: file.stat().st_size for file in (home / DERIVED).iterdir()}
    for version in range(3):
        monkeypatch.setattr(derived, "code", lambda version=version: f"{version:016x}")
        numbers(records(home))
    assert {file: file.stat().st_size for file in (home / DERIVED).iterdir()} == sizes


def test_nothing_is_kept_of_a_log_that_has_just_been_written(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It might be written again within one tick of the file system's clock."""
    monkeypatch.setattr(derived, "SETTLED_NS", 3_600 * 10**9)
    numbers(records(home))
    assert not (home / DERIVED).exists()


def test_a_folder_that_cannot_be_written_is_read_all_the_same(home: Path) -> None:
    """As a link is, through which nothing is written."""
    (home / "elsewhere").mkdir()
    (home / DERIVED).symlink_to("elsewhere")
    assert numbers(records(home)) == numbers(list_runs(home))
    assert not any((home / "elsewhere").iterdir())


def test_verify_reads_the_logs(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever is kept of them."""
    numbers(records(home))
    read: set[str] = set()

    def noted(path: Path, *keys: str) -> list[dict[str, Any]]:
        read.add(path.name)
        return read_log(path, *keys)

    monkeypatch.setattr(derived.Derived, "value", no_log)
    monkeypatch.setattr("msgdrop_cli.records.store.read_log", noted)
    [found] = verified(home, tmp_path / "scratch")
    assert found.looked_at.startswith("2 finished runs")
    assert read == {METRICS, EPISODES}


def test_estimates_are_made_when_they_are_asked_for(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of thousands of rows a figure shows a few."""
    monkeypatch.setattr("msgdrop_cli.analysis.rows.mean_interval", no_log)
    row = summarise(list_runs(home)).arms[0].rows[0]
    assert row.mean == 4.5
    with pytest.raises(AssertionError):
        _ = row.interval


@pytest.mark.parametrize(
    "read",
    [
        lambda place: summarise(runs_in(place)),
        lambda place: summarise(readable_runs(place)[0]),
        msgdrop_cli.results,
    ],
    ids=["listing", "page", "frames"],
)
def test_numbers_are_kept_in_the_results_folder(home: Path, read: Callable[[Path], Any]) -> None:
    """Whichever part of it was named: no run gets a file that is none of its own."""
    run = list_runs(home)[0].path
    for place in (run, run.parent, home / RUNS):
        read(place)
    assert [*home.rglob(DERIVED)] == [home / DERIVED]


def test_nothing_is_kept_in_a_run(home: Path) -> None:
    """That lies in no results folder."""
    alone = list_runs(home)[0].path.rename(home / "alone")
    summarise(runs_in(alone))
    assert not [*home.rglob(DERIVED)]


def test_nothing_is_kept_in_a_copy_of_what_is_published(home: Path) -> None:
    """Every file of it is listed, and one more would be a difference."""
    list_sums(home)
    summarise(runs_in(home))
    assert not [*home.rglob(DERIVED)]


def test_nothing_is_kept_in_a_part_of_such_a_copy(home: Path) -> None:
    """Its list lies a folder above what was named."""
    game = Path(shutil.copytree(home / RUNS, home.parent / "study")) / "pursuit-n6"
    list_sums(game.parent)
    for place in (game.parent, game):
        summarise(runs_in(place))
        assert not [*game.parent.rglob(DERIVED)]


def test_a_log_that_is_replaced_while_it_is_read_is_not_kept(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was counted is of the old file, so it must not stand for the new one."""

    def replaced(path: Path, *numbers: str) -> list[dict[str, Any]]:
        rows = read_log(path, *numbers)
        path.with_name("new").write_text("".join(json.dumps(row) + "\n" for row in rows[:1]))
        path.with_name("new").replace(path)
        return rows

    with monkeypatch.context() as patch:
        patch.setattr("msgdrop_cli.records.store.read_log", replaced)
        assert len(records(home)[0].episodes()[NONE_BROKEN]) > 1
    assert not records(home)[0].has_episodes([NONE_BROKEN], 2)


def test_a_fault_that_passes_is_not_kept(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that fails once, a log that was closed to us: it is read again."""
    published = [replace(run, path=run.path) for run in records(home)]
    monkeypatch.setattr(type(published[0]), "is_own", False)

    def failing(path: Path) -> bytes:
        raise RecordError("EIO")

    with monkeypatch.context() as patch:
        patch.setattr("msgdrop_cli.records.counted.log_bytes", failing)
        assert _rank(published[0], "any")[2] == -1
    assert _rank(records(home)[0], "any")[2] > 0


def test_json_names_the_logs_that_it_was_made_of(home: Path) -> None:
    """Device, inode, size and times of both; and the code."""
    numbers(records(home))
    for file in (home / DERIVED).iterdir():
        made_by, made_of, values = json.loads(file.read_bytes().partition(b"\n")[2])
        assert made_by == code()
        assert len(made_of) == 10
        assert len(values) == 3
