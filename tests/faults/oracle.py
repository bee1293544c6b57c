"""Two results of one study, compared quantity by quantity: where a disturbance shows first.

A digest of everything says that something differs; this says what: a random stream, the optimiser,
the replay memory, the games, the sums, or only the log.
"""

import hashlib
import json
from pathlib import Path

import torch
from torch import Tensor

from msgdrop_cli.engine.checkpoint import Checkpoint, Checkpoints
from msgdrop_cli.engine.tensors import read_tensors
from msgdrop_cli.records.store import EPISODES, POLICY, RunRecord, list_runs
from tests.faults.row import Broken

KEPT = "kept"
"""Beside the results: the last checkpoints, which a finished run deletes (`study.start`)."""
_TIMES = ("wall_time_s",)
_FACTS = ("run_id", "variant", "seed", "spec", "status", "reason", "env_steps", "kernel", "threads")
_GROUPS = {
    **{"online": "network", "target": "target network"},
    **{"exp_avg": "optimiser", "exp_avg_sq": "optimiser", "cut_episodes": "replay"},
    **{"state": "games", "elapsed": "games", "obs": "games"},
    **{"sums": "metric sums", "metric_sums": "metric sums"},
}


def first_difference(expected: Path, found: Path) -> str | None:
    """The first quantity in which two results folders differ, or None.

    What only one of them kept is left out. Random streams come first: what follows differs with
    them.
    """
    ours, theirs = quantities(expected), quantities(found)
    runs = {name.split(": ")[0] for name in ours} ^ {name.split(": ")[0] for name in theirs}
    if runs:
        return f"the run {min(runs)} is on one side only"
    shared = [name for name in ours if name in theirs]
    odd = [name for name in ours.keys() ^ theirs.keys() if f": {KEPT}: " not in name]
    return next((name for name in shared if ours[name] != theirs[name]), min(odd, default=None))


def check_same(expected: Path, found: Path) -> None:
    """Raises Broken, naming the first quantity that differs."""
    if (name := first_difference(expected, found)) is not None:
        raise Broken(f"another result than undisturbed, first in {name}")


def quantities(results: Path) -> dict[str, str]:
    """A digest of each quantity of each run, by name, in the order in which faults would spread."""
    found = {}
    for record in list_runs(results / "runs"):
        run = record.path.name
        for name, content in {**_kept(results, record), **_written(record)}.items():
            found[f"{run}: {name}"] = hashlib.sha256(content).hexdigest()
    return found


def _written(record: RunRecord) -> dict[str, bytes]:
    """What a run's records say, times left out."""
    said: dict[str, bytes] = {}
    for number, row in enumerate(record.metrics()):
        for key in row.keys() - {*_TIMES}:
            said[f"metrics row {number}: {key}"] = json.dumps(row[key]).encode()
    for name, tensor in sorted(read_tensors(record.path / POLICY).items()):
        said[f"policy: {name}"] = _bytes(tensor)
    said["episodes"] = (record.path / EPISODES).read_bytes()
    said["record"] = json.dumps({key: record.run.get(key) for key in _FACTS}).encode()
    return said


def _kept(results: Path, record: RunRecord) -> dict[str, bytes]:
    """What the last checkpoint holds, by groups; empty if none was kept."""
    place = results.parent / KEPT / record.path.name
    checkpoint = Checkpoints(place, record.run_id).latest(10**9) if place.exists() else None
    if checkpoint is None or checkpoint.counters.env_steps < record.env_steps:
        return {}
    spec = record.spec
    held = spec["algorithm"]["replay_capacity"] // spec["training"]["games"] - 1
    return {f"{KEPT}: {name}": content for name, content in parts(checkpoint, held).items()}


def parts(checkpoint: Checkpoint, held: int) -> dict[str, bytes]:
    """The content of a checkpoint by quantity, whatever pieces its replay memory was written in.

    held: steps that the memory still has; the oldest piece may begin with some before them.
    """
    counters = checkpoint.counters
    said = {f"random stream {k}": str(v).encode() for k, v in sorted(counters.streams.items())}
    said["counters"] = repr((counters.env_steps, counters.added, counters.progress)).encode()
    for name, tensor in sorted(checkpoint.state.items()):
        words = name.removeprefix("learner.").split(".")
        said[f"{_GROUPS.get(words[0], words[0])}: {name}"] = _bytes(tensor)
    columns: dict[str, list[Tensor]] = {}
    for stretch in checkpoint.segments.values():
        for name, tensor in stretch.items():
            columns.setdefault(name, []).append(tensor)
    for name, pieces in sorted(columns.items()):
        said[f"replay: {name}"] = _bytes(torch.cat(pieces)[-held:])
    said["metrics: rows"] = repr((counters.rows, counters.logged_at)).encode()
    return said


def _bytes(tensor: Tensor) -> bytes:
    return repr((tuple(tensor.shape), tensor.dtype)).encode() + tensor.numpy().tobytes()
