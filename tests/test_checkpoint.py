"""Damaged, foreign and lost checkpoints: found every time, and the result is undisturbed."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from msgdrop_cli.engine.checkpoint import Checkpoints
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.training import Training
from msgdrop_cli.errors import RunError
from msgdrop_cli.records.files import count_jsonl
from msgdrop_cli.records.seals import Fingerprint, fingerprint
from msgdrop_cli.records.store import METRICS
from tests.runs import StopAt, digest, planned
from tests.stopped_runs import STOPPED, flip, newest, resume, rewrite, segments, stop


@pytest.fixture(autouse=True)
def asked_at_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes `stop` precise: it is asked after every step instead of twice a second."""
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The digest of the undisturbed run."""
    [outcome] = train_cohort([planned()], tmp_path_factory.mktemp("undisturbed"))
    return digest(outcome.path)


@pytest.fixture
def stopped(tmp_path: Path) -> Path:
    """The folder of a run that was stopped after two checkpoints."""
    return stop(tmp_path)


def change_counter(folder: Path) -> None:
    """A digit of a counter in the newest manifest, which stays valid JSON."""
    file = newest(folder) / "MANIFEST.json"
    manifest = json.loads(file.read_text())
    manifest["counters"]["streams"]["replay"] += 1
    file.write_text(json.dumps(manifest))


def nest(folder: Path) -> None:
    """JSON that is nested deeper than Python reads."""
    (newest(folder) / "MANIFEST.json").write_text("[" * 100_000)


def blank_all(folder: Path) -> None:
    """Both manifests are gone."""
    for path in (folder / "checkpoints").glob("0*"):
        (path / "MANIFEST.json").write_text("")


def put_a_folder(folder: Path) -> None:
    """A folder stands where a file of the newest checkpoint should."""
    [segment] = segments(newest(folder))
    segment.unlink()
    (segment / "deep").mkdir(parents=True)


def say_no_size(folder: Path) -> None:
    """A sealed manifest of somebody else, whose size is a word."""
    rewrite(newest(folder), lambda said: said["files"]["state.safetensors"].update(size="many"))


def cut_log(folder: Path) -> None:
    """The log has lost a row that both checkpoints rely on."""
    log = folder / "metrics.jsonl"
    log.write_text("".join(line + "\n" for line in log.read_text().splitlines()[:3]))


DAMAGE: dict[str, tuple[Callable[[Path], object], int]] = {
    "bit of the state": (lambda folder: flip(newest(folder) / "state.safetensors"), 320),
    "bit of a segment": (lambda folder: flip(segments(newest(folder))[0]), 320),
    "segment gone": (lambda folder: segments(newest(folder))[0].unlink(), 320),
    "folder instead of a segment": (put_a_folder, 320),
    "counter changed": (change_counter, 320),
    "manifest nested": (nest, 320),
    "manifest with a word for a size": (say_no_size, 320),
    "manifests blank": (blank_all, 0),
    "log cut": (cut_log, 0),
    "log gone": (lambda folder: (folder / "metrics.jsonl").unlink(), 0),
    "all gone": (lambda folder: shutil.rmtree(folder / "checkpoints"), 0),
}
"""What is done to the folder, and the env steps that the run can still go on from."""


@pytest.mark.parametrize(("damage", "goes_on_from"), DAMAGE.values(), ids=DAMAGE)
def test_damage_is_found_and_the_result_is_the_same(
    damage: Callable[[Path], object], goes_on_from: int, stopped: Path, expected: str
) -> None:
    """The older checkpoint serves, or the run starts over; the record says so once."""
    damage(stopped)
    outcome = resume(stopped)
    start = f"{goes_on_from} env steps" if goes_on_from else "the beginning"
    assert (outcome.status, outcome.reason) == (
        "done",
        f"went on from {start}: what was newer is damaged or gone",
    )
    assert digest(stopped) == expected


@pytest.mark.parametrize(("damage", "goes_on_from"), DAMAGE.values(), ids=DAMAGE)
def test_damage_and_another_stop(
    damage: Callable[[Path], object], goes_on_from: int, stopped: Path, expected: str
) -> None:
    """What replaces damaged files is sound itself: stopped again soon after, still the same."""
    damage(stopped)
    outcome = resume(stopped, StopAt(3))
    assert (outcome.status, outcome.env_steps) == ("interrupted", goes_on_from + 24)
    again = resume(stopped)
    assert (again.status, again.reason) == ("done", None)
    assert digest(stopped) == expected


def test_an_undisturbed_resume_says_nothing(stopped: Path, expected: str) -> None:
    """No note without a reason."""
    assert resume(stopped).reason is None
    assert digest(stopped) == expected


def test_whatever_one_file_suffers_a_checkpoint_is_whole(tmp_path: Path) -> None:
    """No file serves both, also when segments have been taken over from checkpoints before."""
    run = planned(checkpoint_every_env_steps=80)
    [outcome] = train_cohort([run], tmp_path, stop=StopAt(STOPPED))
    files = [path for path in (outcome.path / "checkpoints").rglob("*") if path.is_file()]
    assert len(files) == 8  # of each: manifest, state and two segments
    for number, file in enumerate(files):
        copy = tmp_path / str(number)
        shutil.copytree(outcome.path, copy)
        flip(copy / file.relative_to(outcome.path))
        found = Checkpoints(copy, run.run_id).latest(count_jsonl(copy / METRICS))
        assert found is not None, file
        assert found.counters.env_steps in (320, 360)


def test_a_file_that_has_grown_is_not_read(stopped: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two gigabytes that take no room on a disk would take them in the memory."""
    read: list[int] = []

    def look(content: bytes) -> Fingerprint:
        read.append(len(content))
        return fingerprint(content)

    monkeypatch.setattr("msgdrop_cli.engine.checkpoint.fingerprint", look)
    with (newest(stopped) / "state.safetensors").open("r+b") as file:
        file.truncate(100_000_000)
    found = Checkpoints(stopped, planned().run_id).latest(10**9)
    assert found is not None
    assert found.counters.env_steps == 320
    assert max(read) < 10_000_000


def test_a_long_stretch_is_written_in_pieces(
    tmp_path: Path, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file of more than two gigabytes would not be read again."""
    monkeypatch.setattr("msgdrop_cli.engine.checkpoint.SEGMENT_BYTES", 70_000)
    [outcome] = train_cohort([planned()], tmp_path, stop=StopAt(STOPPED))
    files = segments(newest(outcome.path))
    assert len(files) > 2
    assert max(file.stat().st_size for file in files) < 71_000
    assert resume(outcome.path).reason is None
    assert digest(outcome.path) == expected


def test_another_runs_checkpoints_are_refused(tmp_path: Path, stopped: Path, expected: str) -> None:
    """Whole and sound, but of another seed: the run starts over."""
    [other] = train_cohort([planned(seed=2)], tmp_path / "other", stop=StopAt(STOPPED))
    shutil.rmtree(stopped / "checkpoints")
    shutil.copytree(other.path / "checkpoints", stopped / "checkpoints")
    assert resume(stopped).status == "done"
    assert digest(stopped) == expected


def test_another_kernel_is_refused_before_training(
    stopped: Path, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run stays `interrupted`, and goes on with the kernel that it began with."""
    with monkeypatch.context() as patch:
        patch.setattr("msgdrop_cli.engine.opening.kernel_name", lambda *_: "another")
        with pytest.raises(RunError, match=r"has 'another', .* take the same msgdrop, --device"):
            resume(stopped)
    assert json.loads((stopped / "run.json").read_text())["status"] == "interrupted"
    assert resume(stopped).status == "done"
    assert digest(stopped) == expected


def test_the_log_is_on_disk_before_a_checkpoint_counts_on_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Six windows cost no fsync of the log; each checkpoint has one before it, the end another."""
    tape: list[str] = []
    fsync, save = os.fsync, Checkpoints.save

    def note_sync(handle: int) -> None:
        tape.append(Path(f"/proc/self/fd/{handle}").readlink().name)
        fsync(handle)

    def note_save(*arguments: Any, **counters: Any) -> None:
        tape.append("checkpoint")
        save(*arguments, **counters)

    monkeypatch.setattr(os, "fsync", note_sync)
    monkeypatch.setattr(Checkpoints, "save", note_save)
    train_cohort([planned()], tmp_path)
    found = [name for name in tape if name in (METRICS, "checkpoint")]
    assert found == [*[METRICS, "checkpoint"] * 2, METRICS]  # none at the end: it would go


@pytest.mark.parametrize(("takes", "expected"), [(0.1, [160, 320]), (0.3, [160]), (1.0, [160])])
def test_a_slow_checkpoint_puts_the_next_one_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, takes: float, expected: list[int]
) -> None:
    """What takes 0.3 s is not done again for 18 s: a sixtieth of the time, at most."""
    saved = []
    save, now = Checkpoints.save, [0.0]
    monkeypatch.setattr("msgdrop_cli.engine.run._PUT_OFF", 60)

    def slow(checkpoints: Checkpoints, training: Training, run: int, **counters: Any) -> None:
        save(checkpoints, training, run, **counters)
        saved.append(training.env_steps)
        now[0] += takes

    monkeypatch.setattr(Checkpoints, "save", slow)
    clocks = SimpleNamespace(monotonic=lambda: now[0], process_time=lambda: now[0])
    monkeypatch.setattr("msgdrop_cli.engine.run.time", clocks)
    train_cohort([planned()], tmp_path)
    assert saved == expected


def test_a_minute_is_the_most_that_a_kill_costs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A short or slow run, which its interval in env steps never reaches, has checkpoints, too."""
    saved: list[int] = []
    save = Checkpoints.save

    def note(checkpoints: Checkpoints, training: Training, run: int, **counters: Any) -> None:
        saved.append(training.env_steps)
        save(checkpoints, training, run, **counters)

    ticks = iter(range(0, 100_000, 40))  # seconds, at every look at the clock
    clocks = SimpleNamespace(monotonic=lambda: float(next(ticks)), process_time=lambda: 0.0)
    monkeypatch.setattr(Checkpoints, "save", note)
    monkeypatch.setattr("msgdrop_cli.engine.run.time", clocks)
    [outcome] = train_cohort([planned(checkpoint_every_env_steps=10**9)], tmp_path)
    assert outcome.status == "done"
    assert saved
    assert saved[-1] < planned().spec.training.train_env_steps
