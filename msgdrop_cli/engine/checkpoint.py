"""Exact resume: everything a run's training goes on from, as files that cannot be half there.

    checkpoints/replay/<first>-<last>.safetensors   steps of the replay memory, never rewritten
    checkpoints/<env steps>/state.safetensors       networks, optimiser, games, sums, cut episodes
    checkpoints/<env steps>/MANIFEST.json           counters, and size and SHA-256 of every file

A checkpoint exists if and only if its manifest verifies. Two are kept; the older one serves if
the newer is damaged.
"""

import dataclasses
import hashlib
import json
import os
import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from torch import Tensor

from msgdrop_cli.engine.tensors import copy_into, parse_tensors, write_tensors
from msgdrop_cli.engine.training import Training
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import sync_folder, write_json_atomic

KEPT = 2
_SEGMENT = re.compile(r"(\d{1,15})-(\d{1,15})\.safetensors")


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A verified checkpoint: its counters and the files' contents."""

    path: Path
    counters: Mapping[str, Any]
    state: Mapping[str, Tensor]
    segments: tuple[tuple[int, Mapping[str, Tensor]], ...]
    """First step and tensors of each stretch of the replay memory, in order."""

    @property
    def env_steps(self) -> int:
        """Environment steps trained when it was written."""
        return int(self.counters["env_steps"])


class Checkpoints:
    """The checkpoints of one run."""

    def __init__(self, run_path: Path) -> None:
        self._folder = run_path / "checkpoints"
        self._replay = self._folder / "replay"

    def save(self, training: Training, run: int, counters: Mapping[str, Any]) -> None:
        """Write a checkpoint of run number `run` of the cohort; raises RecordError (73, 74).

        counters: what the caller needs to go on, JSON values.
        """
        try:
            self._replay.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordError(f"{self._folder}: cannot be created: {error.strerror}", 73) from error
        self._write_segment(training, run)
        temporary = self._folder / f".tmp-{os.getpid()}"
        final = self._folder / f"{training.env_steps:015d}"
        try:
            shutil.rmtree(temporary, ignore_errors=True)
            temporary.mkdir()
            write_tensors(temporary / "state.safetensors", _state(training, run))
            files = {f"replay/{s.name}": s for s in self._segments(training)}
            files["state.safetensors"] = temporary / "state.safetensors"
            manifest = {
                "counters": {**counters, **_counters(training)},
                "files": {name: _fingerprint(path.read_bytes()) for name, path in files.items()},
            }
            write_json_atomic(temporary / "MANIFEST.json", manifest)
            shutil.rmtree(final, ignore_errors=True)
            temporary.rename(final)
            sync_folder(self._folder)
        except OSError as error:
            shutil.rmtree(temporary, ignore_errors=True)
            raise RecordError(f"{final}: cannot be written: {error.strerror}", 74) from error
        self._prune()

    def latest(self) -> Checkpoint | None:
        """The newest checkpoint that verifies, or None; a damaged one is passed over."""
        for path in reversed(self._paths()):
            try:
                return self._read(path)
            except RecordError:
                continue
        return None

    def remove(self) -> None:
        """Remove all of them: the run is done."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _paths(self) -> list[Path]:
        return sorted(p for p in self._folder.glob("[0-9]*") if p.is_dir() and not p.is_symlink())

    def _segments(self, training: Training) -> list[Path]:
        """The segments with steps that can still be sampled, in order."""
        oldest = training.replay.added - training.replay.slots + 1
        return [path for _, last, path in self._stretches() if last > oldest]

    def _stretches(self) -> list[tuple[int, int, Path]]:
        found = []
        for path in self._replay.glob("*.safetensors"):
            if match := _SEGMENT.fullmatch(path.name):
                found.append((int(match[1]), int(match[2]), path))
        return sorted(found)

    def _write_segment(self, training: Training, run: int) -> None:
        """Write the steps that no segment holds yet; those after `added` are a lost future's."""
        added = training.replay.added
        for _, last, path in self._stretches():
            if last > added:
                path.unlink()
        saved = max((last for _, last, _ in self._stretches()), default=0)
        first = max(saved, added - training.replay.slots + 1, 0)
        if first < added:
            path = self._replay / f"{first:015d}-{added:015d}.safetensors"
            write_tensors(path, training.replay.stretch(run, first, added))

    def _prune(self) -> None:
        for path in self._paths()[:-KEPT]:
            shutil.rmtree(path, ignore_errors=True)
        used = {name for path in self._paths() for name in _manifest(path).get("files", ())}
        for _, _, path in self._stretches():
            if f"replay/{path.name}" not in used:
                path.unlink(missing_ok=True)

    def _read(self, path: Path) -> Checkpoint:
        try:
            manifest = _manifest(path)
            counters, files = manifest["counters"], manifest["files"]
            contents: dict[str, dict[str, Tensor]] = {}
            for name, fingerprint in files.items():
                file = path / name if name == "state.safetensors" else self._segment_path(name)
                content = file.read_bytes()
                if _fingerprint(content) != fingerprint:
                    raise RecordError(f"{file}: is damaged: it is not what the manifest says")
                contents[name] = parse_tensors(content, file)
            state = contents.pop("state.safetensors")
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise RecordError(f"{path}: is no whole checkpoint") from error
        segments = tuple((_first_step(name), contents[name]) for name in sorted(contents))
        return Checkpoint(path, counters, state, segments)

    def _segment_path(self, name: str) -> Path:
        """The file of a segment named in a manifest; nothing outside the replay folder."""
        base = name.removeprefix("replay/")
        if not _SEGMENT.fullmatch(base):
            raise RecordError(f"{name[:64]!r} is no segment's name")
        return self._replay / base


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


def _manifest(path: Path) -> dict[str, Any]:
    """The manifest of a checkpoint, or nothing if it is damaged."""
    try:
        manifest = json.loads((path / "MANIFEST.json").read_text())
    except (OSError, ValueError):
        return {}
    return manifest if isinstance(manifest, dict) else {}


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


def _fingerprint(content: bytes) -> dict[str, Any]:
    return {"size": len(content), "sha256": hashlib.sha256(content).hexdigest()}


def _first_step(name: str) -> int:
    return int(name.removeprefix("replay/").split("-")[0])
