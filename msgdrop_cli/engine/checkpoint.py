"""Exact resume: everything a run's training goes on from, as files that cannot be half there.

    checkpoints/replay/<first>-<last>-<when>.safetensors  steps of the replay memory
    checkpoints/<env steps>/state.safetensors  networks, optimiser, games, sums, cut episodes
    checkpoints/<env steps>/MANIFEST.json      counters, and size and SHA-256 of every file

A checkpoint exists if and only if its manifest verifies: it names its run, and seals itself. Two
are kept, and no file serves both: whatever is damaged, the other one is whole. So a step of the
replay memory is written twice, once for every second checkpoint.
"""

import dataclasses
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

from torch import Tensor

import msgdrop_cli
from msgdrop_cli.definition.strict import build
from msgdrop_cli.engine.tensors import (
    LARGEST_FILE,
    check_fit,
    copy_into,
    parse_tensors,
    write_tensors,
)
from msgdrop_cli.engine.training import Training
from msgdrop_cli.errors import DefinitionError, RecordError, RunError
from msgdrop_cli.records.files import (
    read_bytes,
    read_json,
    sync_folder,
    write_json_atomic,
)
from msgdrop_cli.records.listings import listed
from msgdrop_cli.records.ours import (
    CHECKPOINTS,
    REPLAY,
    SEGMENT,
    STEPS,
    delete_checkpoints,
)
from msgdrop_cli.records.seals import Fingerprint, fingerprint, seal
from msgdrop_cli.records.temporary import TEMPORARY

KEPT = 2
STATE, MANIFEST = "state.safetensors", "MANIFEST.json"
SEGMENT_BYTES = 2**27
"""Of a longer stretch several segments are made: each is held in memory while it is written."""
_SCHEMA, _FIRST_VERSION = 1, "0.1.0"
"""The first manifests named neither their schema nor the version of msgdrop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Counters:
    """What the tensors do not say about where a run stands."""

    env_steps: int
    added: int
    """Steps that the replay memory was given by each game."""
    streams: Mapping[str, int]
    progress: tuple[int, ...]
    rows: int
    """Rows of the log that belong to it."""
    logged_at: int
    """Env steps at the last of them."""
    kernel: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _Manifest:
    run_id: str
    counters: Counters
    files: Mapping[str, Mapping[str, int | str]]
    schema: int = _SCHEMA
    version: str = _FIRST_VERSION

    def __post_init__(self) -> None:
        if self.schema != _SCHEMA:
            raise ValueError(f"schema {self.schema} is unknown, expected {_SCHEMA}")
        names = sorted(set(self.files) - {STATE})
        if STATE not in self.files or not all(map(SEGMENT.fullmatch, names)):
            raise ValueError("the files are not those of a checkpoint")
        steps = [*map(_steps, names), (self.counters.added, 0)]
        if any(before[1] != after[0] for before, after in pairwise(steps)):
            raise ValueError("a stretch of the replay memory is missing")


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A verified checkpoint: its counters and the files' contents."""

    path: Path
    version: str
    """Of the msgdrop that wrote it."""
    counters: Counters
    state: Mapping[str, Tensor]
    segments: Mapping[str, Mapping[str, Tensor]]
    """The stretches of the replay memory by name, in order."""
    fingerprints: Mapping[str, Fingerprint]
    """Those of the segments."""


class Checkpoints:
    """The checkpoints of one run; only the holder of the run's lock may use them."""

    def __init__(
        self, run_path: Path, run_id: str, check: Callable[[], None] = lambda: None
    ) -> None:
        """check: raises if another process holds it by now; asked before a checkpoint stands."""
        self._run_path, self._run_id, self._check = run_path, run_id, check
        self._folder = run_path / CHECKPOINTS
        self._replay = self._folder / REPLAY
        self._kept: dict[Path, Mapping[str, Fingerprint]] = {}
        """The checkpoints that were written or verified, oldest first, and their segments."""

    def save(self, training: Training, run: int, *, rows: int, logged_at: int, kernel: str) -> None:
        """Write a checkpoint of run number `run` of the cohort; raises RecordError (73, 74).

        rows, logged_at, kernel: see `Counters`.
        """
        counters = Counters(
            env_steps=training.env_steps,
            added=training.replay.added,
            streams=training.streams.positions,
            progress=training.learner.progress,
            rows=rows,
            logged_at=logged_at,
            kernel=kernel,
        )
        final = self._folder / f"{training.env_steps:015d}"
        if final in self._kept:
            return
        try:
            self._replay.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordError(f"{self._folder}: cannot be created: {error.strerror}", 73) from error
        segments = self._write_segments(training, run)
        try:
            with TemporaryDirectory(dir=self._folder, prefix=TEMPORARY) as scratch:
                written = Path(scratch) / "new"
                written.mkdir()
                manifest = {
                    "schema": _SCHEMA,
                    "version": msgdrop_cli.__version__,
                    "run_id": self._run_id,
                    "counters": asdict(counters),
                    "files": {STATE: write_tensors(written / STATE, state_of(training, run))}
                    | segments,
                }
                write_json_atomic(written / MANIFEST, {**manifest, "seal": seal(manifest)})
                self._check()
                written.rename(final)
                sync_folder(self._folder)
        except OSError as error:
            raise RecordError(f"{final}: cannot be written: {error.strerror}", 74) from error
        self._kept[final] = segments
        self._prune()

    def latest(self, log_rows: int) -> Checkpoint | None:
        """The newest checkpoint that verifies, or None.

        log_rows: whole rows in the run's log; a checkpoint that needs more of them is of no use.
        What is damaged, or belongs to a future that is lost with it, is removed.
        Raises RunError for one that is whole but of another version of msgdrop, RecordError if a
        link stands for one of the folders (73) or one cannot be read (2).
        """
        found = None
        paths = [path for path in listed(self._folder) if STEPS.fullmatch(path.name)]
        for path in reversed(paths):
            with suppress(RecordError):
                checkpoint = self._read(path, log_rows)
                self._kept = {path: checkpoint.fingerprints, **self._kept}
                found = found or checkpoint
        self._prune()
        return found

    def remove(self) -> None:
        """Remove all of them: the run is done."""
        delete_checkpoints(self._run_path)

    def _write_segments(self, training: Training, run: int) -> dict[str, Fingerprint]:
        """The replay memory, as files on which the checkpoint before this one does not count.

        Those of the one that goes when this one stands are taken over, and what is newer added.
        """
        replay = training.replay
        oldest = max(replay.added - replay.slots + 1, 0)
        going, *staying = self._kept.values() if len(self._kept) == KEPT else [{}]
        segments = {
            name: known
            for name, known in going.items()
            if _steps(name)[1] > oldest and not any(name in other for other in staying)
        }
        first = max([oldest, *(_steps(name)[1] for name in segments)])
        a_step = sum(tensor.nbytes for tensor in replay.stretch(run, 0, 1).values())
        most = max(SEGMENT_BYTES // a_step, 1)
        for start in range(first, replay.added, most):
            last = min(start + most, replay.added)
            name = f"{start:015d}-{last:015d}-{replay.added:015d}.safetensors"
            segments[name] = write_tensors(self._replay / name, replay.stretch(run, start, last))
        return segments

    def _prune(self) -> None:
        """Keep the newest checkpoints and the segments that they name."""
        self._kept = dict([*self._kept.items()][-KEPT:])
        segments = {self._replay / name for names in self._kept.values() for name in names}
        delete_checkpoints(self._run_path, keep={*self._kept, *segments})

    def _read(self, path: Path, log_rows: int) -> Checkpoint:
        manifest = self._manifest(path)
        if manifest.counters.rows > log_rows:
            raise RecordError(f"{path}: the log has lost rows that were there")
        contents: dict[str, dict[str, Tensor]] = {}
        for name, expected in sorted(manifest.files.items()):
            file = path / name if name == STATE else self._replay / name
            size = expected.get("size")
            content = read_bytes(file, min(size if isinstance(size, int) else 0, LARGEST_FILE))
            if fingerprint(content) != expected:
                raise RecordError(f"{file}: is damaged: it is not what the manifest says")
            contents[name] = parse_tensors(content, file)
        state = contents.pop(STATE)
        fingerprints = {name: dict(manifest.files[name]) for name in contents}
        return Checkpoint(path, manifest.version, manifest.counters, state, contents, fingerprints)

    def _manifest(self, path: Path) -> _Manifest:
        """The manifest of a checkpoint of this run; RecordError for any other."""
        table = read_json(path / MANIFEST)
        if not isinstance(table, dict) or table.pop("seal", None) != seal(table):
            raise RecordError(f"{path / MANIFEST}: is damaged")
        if table.get("run_id") != self._run_id:
            raise RecordError(f"{path}: is a checkpoint of another run")
        try:
            return build(_Manifest, table, str(path / MANIFEST))
        except DefinitionError as error:
            raise _foreign(path, table.get("version", _FIRST_VERSION), error) from error


def restore(training: Training, run: int, checkpoint: Checkpoint) -> bool:
    """Put run number `run` back to where `checkpoint` was written; `training` has begun.

    Returns whether its games stand where they stood: one of other people that does not repeat
    itself from its seed goes on with the same episodes, played differently.
    Raises RunError if it does not fit the run: another version of msgdrop has written it.
    """
    counters, replay, path = checkpoint.counters, training.replay, checkpoint.path
    try:
        for name, tensors in checkpoint.segments.items():
            first, last = _steps(name)
            check_fit(replay.stretch(run, 0, 1), tensors, path / name, rows=last - first)
        if len(counters.progress) != len(training.learner.progress):
            raise RecordError(f"{path}: has other counters of progress")
        copy_into(state_of(training, run), checkpoint.state, path)
    except RecordError as error:
        raise _foreign(path, checkpoint.version, error) from error
    training.env_steps, replay.added = counters.env_steps, counters.added
    training.streams.positions = dict(counters.streams)
    training.learner.resume_at(*counters.progress)
    for name, tensors in checkpoint.segments.items():
        replay.restore_stretch(run, _steps(name)[0], tensors)
    seen, before = training.env.observe(training.games.state)[run], training.games.obs[run]
    is_exact = bool((seen == before).all())
    before.copy_(seen)
    replay.put(run, before, training.lost.arrives[run] if training.lost else None)
    return is_exact


def state_of(training: Training, run: int) -> dict[str, Tensor]:
    """Views of one run's tensors, without its replay memory, in whatever the cohort keeps them."""
    games = training.games
    state = {f"learner.{k}": v for k, v in training.learner.tensors(run).items()}
    for field in dataclasses.fields(games.state):
        state[f"state.{field.name}"] = getattr(games.state, field.name)[run]
    state["elapsed"], state["obs"] = games.elapsed[run], games.obs[run]
    state["sums"] = training.sums[:, run]
    if training.lost:
        state["lost.state"] = training.lost.state[run]
        state["lost.arrives"] = training.lost.arrives[run]
        if training.lost.reach:
            state["lost.waited"] = training.lost.waited[run]
    return state | training.replay.cut_episodes(run)


def _steps(segment: str) -> tuple[int, int]:
    """The first step in a segment, and the first one after it."""
    match = SEGMENT.fullmatch(segment)
    assert match is not None  # the manifest was checked
    return int(match[1]), int(match[2])


def _foreign(path: Path, version: object, error: Exception) -> RunError:
    return RunError(
        f"{error}; another msgdrop ({str(version)[:20]}) wrote it: go on with that one, or remove"
        f" {path.parent} to begin the run anew"
    )
