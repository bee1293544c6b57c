"""Run folders: `runs/<environment>/<variant>-s<seed>-<id>/` with `run.json` and the logs.

What a run is stands in its `run.json`, never in a file name; `folders` finds which ones are ours.
"""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple, get_args

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.definition.strict import Where, build, one_line
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.derived import Derived
from msgdrop_cli.records.episodes import by_channel
from msgdrop_cli.records.files import CANNOT_CREATE, write_json_atomic
from msgdrop_cli.records.folders import EPISODES as EPISODES
from msgdrop_cli.records.folders import METRICS as METRICS
from msgdrop_cli.records.folders import POLICY as POLICY
from msgdrop_cli.records.folders import PROGRESS as PROGRESS
from msgdrop_cli.records.folders import RUN as RUN
from msgdrop_cli.records.folders import run_folders
from msgdrop_cli.records.own_sums import write_record
from msgdrop_cli.records.packed import log_file, read_log
from msgdrop_cli.records.pretraining import Pretraining
from msgdrop_cli.records.run_file import SCHEMA, Status, read_run
from msgdrop_cli.records.setup import Setup, read_setup

RUNS = "runs"
"""The folder of our own runs in a results folder; the published ones lie elsewhere."""
FACTS = (
    *("env_steps", "wall_time_s", "cpu_time_s", "created", "versions", "commit"),
    *("host", "device", "threads", "kernel", "metrics", "pretraining", "node"),
)
"""What the engine knows about a run beside its plan."""
ENDED = ("diverged", "done")
"""Statuses that no training changes any more."""
_LONGEST_REASON = 500
_PLAYED = "episodes through each channel"


@dataclass(frozen=True, slots=True)
class RunRecord:
    """One run on disk, as it was when it was read."""

    path: Path
    run: dict[str, Any]
    """The whole of `run.json`, checked."""
    derived: Derived | None = field(default=None, compare=False, repr=False)
    """What was computed of its logs, where that is kept."""

    @property
    def run_id(self) -> str:
        """The 8 hex digits of the resolved spec."""
        return str(self.run["run_id"])

    @property
    def variant(self) -> str:
        """The arm of the ablation that trained it first."""
        return str(self.run["variant"])

    @property
    def label(self) -> str:
        """What tables and figures call the variant."""
        return str(self.run["label"])

    @property
    def overrides(self) -> tuple[str, ...]:
        """What `--set` changed: `algorithm.gamma=0.9`, `variants.md-0.2.algorithm.rate=0.3`."""
        return tuple(self.run.get("overrides", ()))

    @property
    def registration(self) -> str | None:
        """What had been registered when it was planned; None before there was anything."""
        named = self.run.get("registration")
        return None if named is None else str(named)

    @property
    def environment(self) -> str:
        """The paper's setting, e.g. `pursuit-n6`."""
        return str(self.run["environment"])

    @property
    def seed(self) -> int:
        """The seed of every random stream."""
        return int(self.run["seed"])

    @property
    def status(self) -> str:
        """One of planned, running, done, failed, diverged, interrupted."""
        return str(self.run["status"])

    @property
    def reason(self) -> str | None:
        """Why it failed or diverged, in one line."""
        reason = self.run.get("reason")
        return None if reason is None else str(reason)

    @property
    def profile(self) -> str:
        """The scale it was planned at."""
        return str(self.run["profile"])

    @property
    def definition(self) -> str:
        """The ablation that trained it first."""
        return str(self.run["definition"])

    @property
    def env_steps(self) -> int:
        """Environment steps trained so far."""
        return int(self.run["env_steps"])

    @property
    def spec(self) -> dict[str, Any]:
        """The resolved spec, as `spec_to_dict` made it."""
        return dict(self.run["spec"])

    @property
    def setup(self) -> Setup | None:
        """The spec's tables, if they are such as we write."""
        return read_setup(self.spec)

    @property
    def pretraining(self) -> Pretraining | None:
        """What its encoder has learnt before it began, if that is something."""
        where = Where(str(self.path / RUN)).at("pretraining")
        return build(Pretraining, table, where) if (table := self.run.get("pretraining")) else None

    @property
    def is_own(self) -> bool:
        """Whether it stands where training puts it, in `runs/<environment>/<run>`."""
        return self.path.resolve().parts[-3:-2] == (RUNS,)

    def metrics(self) -> list[dict[str, Any]]:
        """The rows of `metrics.jsonl`, none before the first; RecordError if damaged."""
        return read_log(self.path / METRICS, "env_steps")

    def episodes(self) -> dict[Channel, list[dict[str, Any]]]:
        """The raw evaluation episodes, channel by channel; RecordError if damaged."""
        if self.derived:
            self.derived.begin()
        found = self._read_episodes()
        self.derive(_PLAYED, lambda: _counts(found))  # `has_episodes` need not read them again
        return found

    def _read_episodes(self) -> dict[Channel, list[dict[str, Any]]]:
        log = self.path / EPISODES
        return by_channel(read_log(log, "episode"), log_file(log))

    def derive(self, name: str, make: Callable[[], Any]) -> Any:
        """A JSON value that `make` computes of the logs, or computed once if it is kept.

        make: code of `sources`, which decides all but the logs. Raises what it raises.
        """
        return self.derived.value(name, make) if self.derived else make()

    def has_episodes(self, channels: Iterable[Channel], count: int) -> bool:
        """Whether it has at least `count` episodes of each channel; RecordError if damaged."""
        played = dict(self.derive(_PLAYED, lambda: _counts(self._read_episodes())))
        wanted = (played.get(name, 0) for each in channels for name in each.entry.values())
        return all(episodes >= count for episodes in wanted)


def _counts(episodes: Mapping[Channel, Sequence[Any]]) -> list[tuple[Any, ...]]:
    """What each channel is called in a log, and how many episodes it has."""
    return [(*channel.entry.values(), len(rows)) for channel, rows in episodes.items()]


class Listing(NamedTuple):
    """The runs in a folder."""

    records: list[RunRecord]
    """Sorted by path."""
    passed_over: str
    """What else is there, in a line; empty if there is nothing."""


def run_path(root: Path, planned: PlannedRun) -> Path:
    """The folder of a run in the results folder `root`; nothing is created."""
    folder = f"{planned.variant}-s{planned.spec.seed}-{planned.run_id}"
    return root / RUNS / planned.spec.environment / folder


def look_through(root: Path) -> Listing:
    """Every run in or below `root` (a results folder, a part of it, or one run), sorted by path.

    Raises RecordError, in one line: no such folder, no run in it, or a damaged or unknown record.
    """
    found = run_folders(root)
    if not found.runs:
        words = found.passed_over_in_words() or f"no {RUN} in or below"
        raise RecordError(one_line(f"{root}: holds no runs of msgdrop ({words})"))
    return Listing(list(map(_record, found.runs)), found.passed_over_in_words())


def list_runs(root: Path) -> list[RunRecord]:
    """The runs of `look_through`, for who knows the folder."""
    return look_through(root).records


def find_run(root: Path, run_id: str) -> RunRecord | None:
    """The run with this id in or below `root`; of several, the one whose `standing` is highest.

    Raises RecordError if its record is damaged; damage of other runs does not matter here.
    """
    try:
        if not root.is_dir():
            return None
    except OSError:  # a name that is too long, a folder that is closed to us: no run either
        return None
    folders = [path for path in run_folders(root).runs if path.name.endswith(f"-{run_id}")]
    found = [record for record in map(_record, folders) if record.run_id == run_id]
    return max(found, key=standing, default=None)


def standing(record: RunRecord) -> tuple[bool, bool, int]:
    """Which of our own copies of a run counts: one that has ended, best done, else the longest."""
    return record.status in ENDED, record.status == "done", record.env_steps


def create_run(path: Path, planned: PlannedRun, facts: Mapping[str, Any]) -> RunRecord:
    """Writes the first `run.json` of a run, status `planned`; `facts` has keys of FACTS.

    Raises RecordError if the folder cannot be made (73), has a record already (73), or cannot be
    written (74).
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = one_line(f"{path}: cannot be created: {error.strerror}")
        raise RecordError(message, CANNOT_CREATE) from error
    if os.path.lexists(path / RUN):
        raise RecordError(one_line(f"{path / RUN}: exists already"), CANNOT_CREATE)
    run = {
        "schema": SCHEMA,
        "run_id": planned.run_id,
        "variant": planned.variant,
        "label": planned.label,
        "overrides": list(planned.overrides),
        "definition": planned.definition,
        "profile": planned.profile,
        "registration": planned.registration,
        "status": "planned",
        "reason": None,
        "environment": planned.spec.environment,
        "seed": planned.spec.seed,
        "spec": spec_to_dict(planned.spec),
        "env_steps": 0,
        "wall_time_s": 0.0,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        **_checked_facts(facts),
    }
    write_json_atomic(path / RUN, run)
    return _record(path)


def set_status(path: Path, status: Status, reason: str | None = None, **facts: Any) -> RunRecord:
    """Rewrites `run.json` with a new status word, its reason in one line, and newer facts.

    Raises RecordError: the record is damaged (2) or cannot be written (74).
    """
    if status not in get_args(Status):
        raise ValueError(f"no status is called {status!r}")
    why = one_line(reason)[:_LONGEST_REASON] if reason else None
    run = {**_record(path).run, "status": status, "reason": why or None, **_checked_facts(facts)}
    write_record(path, run)
    return _record(path)


def _record(path: Path) -> RunRecord:
    return RunRecord(path, read_run(path / RUN))


def _checked_facts(facts: Mapping[str, Any]) -> Mapping[str, Any]:
    if unknown := set(facts) - set(FACTS):
        raise ValueError(f"not a fact of a run: {min(unknown)}")
    return facts
