"""Trials on damaged checkpoints: what is loaded is what was written, or it is not loaded."""

import shutil
from contextlib import suppress
from pathlib import Path

from msgdrop_cli.engine.checkpoint import Checkpoint, Checkpoints
from msgdrop_cli.records.files import count_jsonl
from msgdrop_cli.records.store import METRICS, list_runs
from tests.faults.oracle import parts
from tests.faults.row import Broken, Trial, expect
from tests.faults.study import command, go_on, newest_checkpoint, start, wait_until

_CONTINUED = 40
"""One trial of so many trains on from what was found."""


def damage_a_checkpoint(trial: Trial) -> None:
    """A file of the two checkpoints is cut, changed in one bit, or another run's stands there."""
    stopped = _stopped(trial, 1)
    results = trial.folder / "results"
    shutil.copytree(stopped, results)
    [record] = list_runs(results)
    sound = _by_steps(stopped)
    files = sorted(path for path in (record.path / "checkpoints").rglob("*") if path.is_file())
    file = trial.rng.choice(files)
    kind = _damage(trial, file, results)
    what = f"{kind} {file.relative_to(record.path)}"
    found = Checkpoints(record.path, record.run_id).latest(count_jsonl(record.path / METRICS))
    expect(found is not None, f"{what}: no checkpoint serves any more")
    assert found is not None
    same = parts(found, 10**9) == parts(sound[found.counters.env_steps], 10**9)
    expect(same, f"{what}: it was loaded silently")
    if trial.number % _CONTINUED == 0:
        go_on(trial, command(trial.bench, results))


def _damage(trial: Trial, file: Path, results: Path) -> str:
    """Damage one file; returns how."""
    content = bytearray(file.read_bytes())
    kind = trial.rng.choice(("truncated", "one bit flipped", "swapped"))
    if kind == "truncated":
        file.write_bytes(content[: trial.rng.randrange(len(content))])
    elif kind == "one bit flipped":
        place = trial.rng.randrange(8 * len(content))
        content[place // 8] ^= 1 << place % 8
        file.write_bytes(content)
    else:
        other = trial.rng.choice(
            [each for each in _stopped(trial, 2).rglob("*") if each.name[-5:] == file.name[-5:]]
        )
        expect(other.read_bytes() != content, "nothing to swap")
        shutil.copyfile(other, file)
    return kind


def _by_steps(stopped: Path) -> dict[int, Checkpoint]:
    """The sound checkpoints of a stopped study, by env steps."""
    [record] = list_runs(stopped)
    checkpoints = Checkpoints(record.path, record.run_id)
    rows = count_jsonl(record.path / METRICS)
    return {
        int(path.name): checkpoints._read(path, rows)
        for path in (record.path / "checkpoints").glob("0*")
    }


def _stopped(trial: Trial, seed: int) -> Path:
    """A study of one seed that was killed after its second checkpoint; made once for all trials."""
    made = trial.bench / f"stopped-{seed}"
    if not made.exists():
        results = trial.folder / f"made-{seed}" / "results"
        results.parent.mkdir()
        again = command(trial.bench, results)
        again[again.index("--seed") + 1] = str(seed)
        process = start(again, results.parent)
        if not wait_until(lambda: newest_checkpoint(results) >= 240, process):
            raise Broken("it was done before it could be stopped")
        process.send()
        process.wait()
        [record] = list_runs(results)
        # What was being written is not of interest here, and goes at the next start.
        Checkpoints(record.path, record.run_id).latest(count_jsonl(record.path / METRICS))
        with suppress(OSError):  # another trial was faster
            results.rename(made)
    return made
