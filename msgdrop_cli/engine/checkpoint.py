"""Exact resume: everything a run's training goes on from, as files that cannot be half there.

    checkpoints/replay/<first>-<last>.safetensors   steps of the replay memory, never rewritten
    checkpoints/<env steps>/state.safetensors       networks, optimiser, games, sums, cut episodes
    checkpoints/<env steps>/MANIFEST.json           counters, and size and SHA-256 of every file

A checkpoint exists if and only if its manifest verifies: it names its run, and seals itself. Two
are kept; the older one serves if the newer is damaged.
"""

import dataclasses
import os
import re
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from torch import Tensor

from msgdrop_cli.engine.tensors import (
    LARGEST_FILE,
    copy_into,
    parse_tensors,
    write_tensors,
)
from msgdrop_cli.engine.training import Training
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import read_bytes, read_json, sync_folder, write_json_atomic
from msgdrop_cli.records.seals import Fingerprint, fingerprint, seal

KEPT = 2
STATE, MANIFEST = "state.safetensors", "MANIFEST.json"
_SEGMENT = re.compile(r"(\d{1,15})-(\d{1,15})\.safetensors")


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A verified checkpoint: its counters and the files' contents."""

    path: Path
    counters: Mapping[str, Any]
    files: Mapping[str, Fingerprint]
    state: Mapping[str, Tensor]
    segments: tuple[tuple[int, Mapping[str, Tensor]], ...]
    """First step and tensors of each stretch of the replay memory, in order."""

    @property
    def env_steps(self) -> int:
        """Environment steps trained when it was written."""
        return int(self.counters["env_steps"])


class Checkpoints:
    """The checkpoints of one run; only the holder of the run's lock may use them."""

    def __init__(self, run_path: Path, run_id: str) -> None:
        self._folder = run_path / "checkpoints"
        self._replay = self._folder / "replay"
        self._run_id = run_id
        self._known: dict[str, Fingerprint] = {}
        """Fingerprints of the segments, from when they were written or verified."""

    def save(self, training: Training, run: int, counters: Mapping[str, Any]) -> None:
        """Write a checkpoint of run number `run` of the cohort; raises RecordError (73, 74).

        counters: what the caller needs to go on, JSON values.
        """
        try:
            self._replay.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordError(f"{self._folder}: cannot be created: {error.strerror}", 73) from error
        self._write_segment(training, run)
        oldest = training.replay.added - training.replay.slots + 1
        temporary = self._folder / f".tmp-{os.getpid()}"
        final = self._folder / f"{training.env_steps:015d}"
        try:
            shutil.rmtree(temporary, ignore_errors=True)
            temporary.mkdir()
            state = write_tensors(temporary / STATE, _state(training, run))
            live = {name: known for name, known in self._known.items() if _steps(name)[1] > oldest}
            manifest = {
                "run_id": self._run_id,
                "counters": {**counters, **_counters(training)},
                "files": {STATE: state, **live},
            }
            sealed = {**manifest, "seal": seal(manifest)}
            write_json_atomic(temporary / MANIFEST, sealed)
            shutil.rmtree(final, ignore_errors=True)
            temporary.rename(final)
            sync_folder(self._folder)
        except OSError as error:
            shutil.rmtree(temporary, ignore_errors=True)
            raise RecordError(f"{final}: cannot be written: {error.strerror}", 74) from error
        self._prune()

    def latest(self, log_rows: int) -> Checkpoint | None:
        """The newest checkpoint that verifies, or None.

        log_rows: whole rows in the run's log; a checkpoint that needs more of them is of no use.
        What is damaged, or belongs to a future that is lost with it, is removed.
        """
        found = None
        for path in reversed(self._paths()):
            try:
                found = self._read(path, log_rows)
                break
            except RecordError:
                shutil.rmtree(path, ignore_errors=True)
        self._known = {n: f for n, f in found.files.items() if n != STATE} if found else {}
        for segment in self._replay.glob("*"):
            if segment.name not in self._known:
                segment.unlink(missing_ok=True)
        for leftover in self._folder.glob(".tmp-*"):
            shutil.rmtree(leftover, ignore_errors=True)
        return found

    def remove(self) -> None:
        """Remove all of them: the run is done."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _paths(self) -> list[Path]:
        return sorted(p for p in self._folder.glob("[0-9]*") if p.is_dir() and not p.is_symlink())

    def _write_segment(self, training: Training, run: int) -> None:
        """Write the steps of the replay memory that no segment holds yet."""
        added = training.replay.added
        saved = max((_steps(name)[1] for name in self._known), default=0)
        first = max(saved, added - training.replay.slots + 1, 0)
        if first < added:
            name = f"{first:015d}-{added:015d}.safetensors"
            stretch = training.replay.stretch(run, first, added)
            self._known[name] = write_tensors(self._replay / name, stretch)

    def _prune(self) -> None:
        """Keep the newest checkpoints and the segments that they name."""
        for path in self._paths()[:-KEPT]:
            shutil.rmtree(path, ignore_errors=True)
        used: set[str] = set()
        for path in self._paths():
            with suppress(RecordError):
                used |= set(self._manifest(path)["files"])
        for name in set(self._known) - used:
            del self._known[name]
            (self._replay / name).unlink(missing_ok=True)

    def _manifest(self, path: Path) -> dict[str, Any]:
        """The manifest of a checkpoint of this run; RecordError for any other."""
        manifest = read_json(path / MANIFEST)
        if not isinstance(manifest, dict) or manifest.pop("seal", None) != seal(manifest):
            raise RecordError(f"{path / MANIFEST}: is damaged")
        if manifest["run_id"] != self._run_id:
            raise RecordError(f"{path}: is a checkpoint of the run {manifest['run_id']}")
        return manifest

    def _read(self, path: Path, log_rows: int) -> Checkpoint:
        manifest = self._manifest(path)
        if manifest["counters"]["rows"] > log_rows:
            raise RecordError(f"{path}: the log has lost rows that were there")
        contents: dict[str, dict[str, Tensor]] = {}
        for name, expected in manifest["files"].items():
            file = path / name if name == STATE else self._replay / name
            content = read_bytes(file, LARGEST_FILE)
            if fingerprint(content) != expected:
                raise RecordError(f"{file}: is damaged: it is not what the manifest says")
            contents[name] = parse_tensors(content, file)
        state = contents.pop(STATE)
        segments = tuple((_steps(name)[0], contents[name]) for name in sorted(contents))
        return Checkpoint(path, manifest["counters"], manifest["files"], state, segments)


def restore(training: Training, run: int, checkpoint: Checkpoint) -> None:
    """Put run number `run` back to where `checkpoint` was written; `training` has begun.

    Raises RecordError (2) if the checkpoint is another run's.
    """
    copy_into(_state(training, run), checkpoint.state, checkpoint.path)
    counters = checkpoint.counters
    training.env_steps = int(counters["env_steps"])
    training.replay.added = int(counters["added"])
    training.streams.positions = {name: int(n) for name, n in counters["streams"].items()}
    training.learner.resume_at(*(int(n) for n in counters["progress"]))
    for first, tensors in checkpoint.segments:
        training.replay.restore_stretch(run, first, tensors)
    training.replay.put(run, training.games.obs[run])


def _state(training: Training, run: int) -> dict[str, Tensor]:
    """Views of one run's tensors, in whatever the cohort keeps them."""
    games = training.games
    state = {f"learner.{k}": v for k, v in training.learner.tensors(run).items()}
    for field in dataclasses.fields(games.state):
        state[f"state.{field.name}"] = getattr(games.state, field.name)[run]
    state["elapsed"], state["obs"] = games.elapsed[run], games.obs[run]
    state["sums"] = training.sums[:, run]
    state["cut_episodes"] = training.replay.cut_episodes(run)
    return state


def _counters(training: Training) -> dict[str, Any]:
    return {
        "env_steps": training.env_steps,
        "added": training.replay.added,
        "streams": training.streams.positions,
        "progress": training.learner.progress,
    }


def _steps(segment: str) -> tuple[int, int]:
    """The first step in a segment, and the first one after it."""
    match = _SEGMENT.fullmatch(segment)
    if match is None:
        raise RecordError(f"{segment[:64]!r} is no segment's name")
    return int(match[1]), int(match[2])
