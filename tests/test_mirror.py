"""`msgdrop mirror`: what the records say, in the mirror once, under the field's names."""

import json
import os
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.errors import RecordError, to_install
from msgdrop_cli.records.files import append_jsonl, cut_jsonl
from msgdrop_cli.records.store import RunRecord, list_runs
from msgdrop_cli.report import mirrors
from msgdrop_cli.report.mirroring import Mirroring, training
from tests.cli_runs import ROOT, msgdrop
from tests.fake_runs import write_run
from tests.processes import wait_for

Added = list[tuple[str, int, Mapping[str, float]]]


class Fake:
    """A mirror that keeps what it is given."""

    def __init__(self, into: Path) -> None:
        self.added: Added = []
        self.closed = list[str]()

    def add(self, record: RunRecord, step: int, values: Mapping[str, float], at_s: float) -> None:
        """Keep it."""
        self.added.append((record.run_id, step, values))

    def flush(self) -> None:
        """Nothing to do."""

    def close(self, record: RunRecord) -> None:
        """Keep it."""
        self.closed.append(record.run_id)


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """Two runs of 1,000 env steps, logged every 250 and evaluated."""
    for seed in (1, 2):
        write_run(tmp_path / "results", "dcc", seed, catches={0.0: 5})
    return tmp_path / "results"


def steps(added: Added, run_id: str) -> list[int]:
    """The env steps of what was added to a run."""
    return [step for name, step, _ in added if name == run_id]


def test_names_are_those_of_the_field() -> None:
    """Numbers are not changed, and what is null is left out."""
    row = {
        **{"env_steps": 5000, "epsilon": 0.5, "loss": None, "q": -0.5, "wall_time_s": 2.0},
        **{"catches_per_500": 3.0, "return_per_episode": -7.0, "steps_to_finish": 500.0},
    }
    assert training(row) == {
        "rollout/exploration_rate": 0.5,
        "train/q_values": -0.5,
        "time/time_elapsed": 2.0,
        "time/fps": 2500.0,
        "rollout/catches_per_500": 3.0,
        "rollout/ep_rew_mean": -7.0,
        "rollout/ep_len_mean": 500.0,
    }


def test_every_row_is_copied_once(results: Path, tmp_path: Path) -> None:
    """And the evaluation after the training; by another process, too."""
    records = list_runs(results)
    fake = Fake(tmp_path)
    assert Mirroring(fake, tmp_path).copy(records) == 2 * (4 + 1)
    assert steps(fake.added, records[0].run_id) == [250, 500, 750, 1000, 1000]
    assert "eval/mean_reward" in fake.added[4][2]
    assert Mirroring(fake, tmp_path).copy(records) == 0


def test_a_run_in_training_is_followed(results: Path, tmp_path: Path) -> None:
    """Rows that come later are added alone, also after it went back to a checkpoint."""
    record = list_runs(results)[0]
    log = record.path / "metrics.jsonl"
    rows = record.metrics()
    cut_jsonl(log, 2)
    fake = Fake(tmp_path)
    mirroring = Mirroring(fake, tmp_path)
    mirroring.copy([record])
    append_jsonl(log, rows[2])
    mirroring.copy([record])
    cut_jsonl(log, 1)  # killed, and resumed
    append_jsonl(log, *rows[1:])
    mirroring.copy([record])
    assert [step for step in steps(fake.added, record.run_id) if step < 1000] == [250, 500, 750]
    assert steps(fake.added, record.run_id).count(1000) == 2  # the row and the evaluation


def test_more_episodes_are_copied_again(results: Path, tmp_path: Path) -> None:
    """Through each channel by its name."""
    [record, *_] = list_runs(results)
    fake = Fake(tmp_path)
    mirroring = Mirroring(fake, tmp_path)
    mirroring.copy([record])
    episodes = [{**row, "broken_links": 0.5} for each in record.episodes().values() for row in each]
    append_jsonl(record.path / "episodes.jsonl", *episodes)
    mirroring.copy([record])
    assert "eval/mean_reward/links:0.5" in fake.added[-1][2]
    assert "eval/mean_reward" not in fake.added[-1][2]


def test_the_records_stay_as_they_are(results: Path, tmp_path: Path, monkeypatch: Any) -> None:
    """Byte by byte; by default the mirror's files stand in a folder of their own."""
    monkeypatch.setitem(mirrors.MIRRORS, "tensorboard", Fake)
    before = {path: path.read_bytes() for path in results.rglob("*") if path.is_file()}
    said = msgdrop("mirror", results)
    assert said.code == 0, said.err
    after = {path: path.read_bytes() for path in results.rglob("*") if path.is_file()}
    assert {path: after[path] for path in before} == before
    assert {*after} - {*before} == {results / "mirrors" / "tensorboard" / "mirrored.json"}


def change_row(log: Path, **changes: object) -> None:
    """The first row of a log says something else."""
    first, *rest = log.read_text().splitlines()
    changed = json.dumps({**json.loads(first), **changes})
    log.write_text("\n".join([changed, *rest, ""]))


@pytest.mark.parametrize(
    ("log", "key", "value"),
    [
        ("episodes.jsonl", "steps", "x"),
        ("episodes.jsonl", "return", None),
        ("metrics.jsonl", "env_steps", 1e99),
    ],
)
def test_rows_that_are_none_of_ours_are_an_error_in_a_line(
    results: Path, tmp_path: Path, log: str, key: str, value: object
) -> None:
    """What somebody else's log says is no reason for a traceback."""
    record = list_runs(results)[0]
    change_row(record.path / log, **{key: value})
    with pytest.raises(RecordError, match=log):
        Mirroring(Fake(tmp_path), tmp_path).copy([record])


def test_a_time_that_is_none_is_no_time(results: Path, tmp_path: Path) -> None:
    """The row is copied all the same."""
    record = list_runs(results)[0]
    change_row(record.path / "metrics.jsonl", wall_time_s="a while")
    fake = Fake(tmp_path)
    assert Mirroring(fake, tmp_path).copy([record]) == 4 + 1
    assert "time/fps" not in fake.added[0][2]


@pytest.mark.parametrize("mark", ["[]", '{"a": 1}', '{"a": {"env_steps": "x", "episodes": {}}}'])
def test_a_mark_from_others_is_checked(results: Path, tmp_path: Path, mark: str) -> None:
    """It comes along with a results folder."""
    (tmp_path / "mirrored.json").write_text(mark)
    with pytest.raises(RecordError, match="remove the folder"):
        Mirroring(Fake(tmp_path), tmp_path)


@pytest.mark.parametrize("link", ["mirrors", "mirrors/tensorboard"])
def test_nothing_is_written_through_a_link(
    results: Path, tmp_path: Path, monkeypatch: Any, link: str
) -> None:
    """Of somebody's results folder, which could lead anywhere."""
    monkeypatch.setitem(mirrors.MIRRORS, "tensorboard", Fake)
    (elsewhere := tmp_path / "elsewhere").mkdir()
    (results / link).parent.mkdir(exist_ok=True)
    (results / link).symlink_to(elsewhere)
    said = msgdrop("mirror", results)
    assert said.code == 73
    assert "is a symbolic link" in said.err
    assert not list(elsewhere.iterdir())


def test_no_run_is_mirrored_through_a_link(results: Path, tmp_path: Path) -> None:
    """Nor the folder of a run in the mirror."""
    (into := tmp_path / "into").mkdir()
    (into / "pursuit-n6").symlink_to(tmp_path)
    with pytest.raises(RecordError, match="is a symbolic link"):
        Mirroring(Fake(into), into).copy(list_runs(results))


@pytest.mark.parametrize("package", mirrors.MIRRORS)
def test_what_is_not_installed_is_named(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the extra that brings it."""
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setenv("TRACKIO_DIR", str(tmp_path))
    said = msgdrop("mirror", tmp_path, "--to", package)
    assert said.code == 2
    assert to_install(package) in said.err
    assert "did you mean 'wandb'?" in msgdrop("mirror", "--to", "wand").err


def scalars(file: Path) -> Iterator[tuple[int, str, float]]:
    """Step, tag and value of every scalar in an event file, read as its format is described.

    A record is its length, that length's checksum, so many bytes and their checksum.
    """
    content = file.read_bytes()
    while content:
        (length,) = struct.unpack("<Q", content[:8])
        event, content = fields(content[12 : 12 + length]), content[16 + length :]
        for number, summary in event:
            for _, value in fields(summary) if number == 5 else ():
                found = dict(fields(value))
                step = dict(event).get(2, 0)
                yield step, found[1].decode(), struct.unpack("<f", found[2])[0]


def fields(message: bytes) -> list[tuple[int, Any]]:
    """Number and content of each field of a protocol buffer."""
    found = list[tuple[int, Any]]()
    place = 0

    def varint() -> int:
        nonlocal place
        value = shift = 0
        while True:
            byte = message[place]
            place += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    while place < len(message):
        key = varint()
        number, kind = key >> 3, key & 7
        if kind == 0:
            found.append((number, varint()))
            continue
        length = {1: 8, 5: 4}.get(kind) or varint()
        found.append((number, message[place : place + length]))
        place += length
    return found


def test_event_files_hold_the_log(results: Path, tmp_path: Path) -> None:
    """Every number of every row, at its env step, as another reader finds it."""
    pytest.importorskip("tensorboard", reason="the extra `tensorboard` is not installed")
    said = msgdrop("mirror", results, "--into", tmp_path / "new")
    assert said.code == 0, said.err
    record = list_runs(results)[0]
    [file] = (tmp_path / "new" / record.environment / record.path.name).glob(
        "events.out.tfevents.*"
    )
    found = {(step, tag): value for step, tag, value in scalars(file)}
    for row in record.metrics():
        for tag, value in training(row).items():
            assert found[row["env_steps"], tag] == pytest.approx(value, rel=1e-6)
    assert (1000, "eval/mean_reward") in found
    assert len(found) == len(list(scalars(file)))


@pytest.mark.slow
def test_following_ends_with_a_signal(results: Path, tmp_path: Path) -> None:
    """What has been copied by then is there."""
    pytest.importorskip("tensorboard", reason="the extra `tensorboard` is not installed")
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
    with subprocess.Popen(
        [
            *(sys.executable, "-m", "msgdrop_cli", "mirror", str(results)),
            *("--follow", "--into", str(tmp_path / "new")),
        ],
        env={**os.environ, "PYTHONPATH": paths},
        stdout=subprocess.PIPE,
    ) as process:
        try:
            wait_for((tmp_path / "new" / "mirrored.json").exists)
            process.send_signal(signal.SIGTERM)
            out, _ = process.communicate(timeout=20)
        finally:
            process.kill()
        assert process.returncode == 143
    assert b"10 new rows" in out
    assert len(json.loads((tmp_path / "new" / "mirrored.json").read_text())) == 2
