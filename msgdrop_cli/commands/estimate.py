"""What a plan will cost: which runs are new, how long they take, how much disk they fill."""

import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from msgdrop_cli.commands.words import size
from msgdrop_cli.definition.cohorts import group
from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import CANNOT_CREATE, CANNOT_WRITE
from msgdrop_cli.records.store import RUNS, RunRecord, find_run

_RULE_PARAMETERS = 6 * 88_053
_RULE_STEPS_PER_S = 1_300.0
"""Measured for DCC on pursuit N=6 with that many parameters, one core (benchmarks/throughput)."""
_CHECKPOINTS = 2
_COPIES = 4
"""Of the parameters in a checkpoint: online, target, and Adam's two moments."""
_BYTES_A_LOG_ROW = 350
_BYTES_AN_EPISODE = 130


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """The distinct runs of a plan and what the store has of them."""

    runs: tuple[PlannedRun, ...]
    """Each run id once."""
    records: Mapping[str, RunRecord]
    """By run id."""

    @property
    def pending(self) -> tuple[PlannedRun, ...]:
        """The runs to be trained: neither finished nor diverged, which they would do again."""
        return tuple(run for run in self.runs if self.status(run) not in ("done", "diverged"))

    @property
    def resumable(self) -> tuple[PlannedRun, ...]:
        """Those pending that have been trained for a while."""
        return tuple(run for run in self.pending if self.env_steps(run))

    def env_steps(self, run: PlannedRun) -> int:
        """Env steps that the run has behind it."""
        return self.records[run.run_id].env_steps if run.run_id in self.records else 0

    def env_steps_left(self, run: PlannedRun) -> int:
        """Env steps that the run has before it."""
        return max(0, run.spec.training.train_env_steps - self.env_steps(run))

    def status(self, run: PlannedRun) -> str:
        """The status word of the run's record; planned without one."""
        return self.records[run.run_id].status if run.run_id in self.records else "planned"


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What the pending runs need."""

    seconds: float
    source: str
    """Where the speed comes from."""
    disk_bytes: int
    """At the busiest moment; most of it is given back."""


def survey(runs: Sequence[PlannedRun], root: Path) -> Survey:
    """Look up every run of a plan in the results folder; RecordError for a damaged record."""
    distinct: dict[str, PlannedRun] = {}
    for run in runs:
        distinct.setdefault(run.run_id, run)
    found = {run_id: find_run(root / RUNS, run_id) for run_id in distinct}
    return Survey(
        runs=tuple(distinct.values()),
        records={run_id: record for run_id, record in found.items() if record is not None},
    )


def cohorts(runs: Sequence[PlannedRun], workers: int, device: str) -> list[tuple[PlannedRun, ...]]:
    """The runs that train stacked. On a processor alone: stacking gains 5%, and a fault costs all.

    On a GPU launches are what takes the time, so as many as there are for each worker.
    """
    together = -(-len(runs) // workers) if device == "cuda" else 1
    return group(runs, together) if runs else []


def estimate(
    looked_up: Survey,
    tasks: Sequence[Sequence[PlannedRun]],
    finished: Sequence[RunRecord],
    *,
    workers: int,
    device: str,
    episodes: int,
) -> Estimate:
    """Time and disk for the cohorts `tasks`; `finished` are runs whose speed may be known.

    Loads torch, to measure the learner's size.
    """
    sizes = {run.run_id: _sizes(run) for run in looked_up.pending}
    measured = 0
    busy = [0.0] * workers
    for task in tasks:
        seconds = 0.0
        for run in task:
            speed = _measured_speed(run, finished, device)
            measured += speed is not None
            speed = speed or _rule_of_thumb(sizes[run.run_id].parameters)
            alone = looked_up.env_steps_left(run) / speed
            seconds = max(seconds, alone) if device == "cuda" else seconds + alone
        busy[busy.index(min(busy))] += seconds
    source = "measured on finished runs here"
    if measured < sum(map(len, tasks)):
        source = f"rule of thumb: {_RULE_STEPS_PER_S:,.0f} env steps/s a core for DCC, pursuit N=6"
    at_work = sorted((sum(sizes[r.run_id].working for r in task) for task in tasks), reverse=True)
    kept = sum(sizes[run.run_id].kept + episodes * _BYTES_AN_EPISODE for run in looked_up.pending)
    disk = kept + sum(at_work[:workers])
    return Estimate(seconds=max(busy), source=source, disk_bytes=disk)


def check_folder(root: Path, needed_bytes: int) -> None:
    """Refuse to begin where the results cannot be written; makes the folder.

    Raises RecordError: cannot be created (73), not writable or too little disk (74).
    """
    try:
        root.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordError(f"{root}: cannot be created: {error.strerror}", CANNOT_CREATE) from error
    try:
        with tempfile.TemporaryFile(dir=root):
            pass
        free = shutil.disk_usage(root).free
    except OSError as error:
        raise RecordError(f"{root}: cannot be written: {error.strerror}", CANNOT_WRITE) from error
    if free < needed_bytes:
        raise RecordError(
            f"{os.fspath(root)}: needs {size(needed_bytes)} ({needed_bytes:,} bytes) of disk, "
            f"{size(free)} ({free:,} bytes) are free",
            CANNOT_WRITE,
        )


@dataclass(frozen=True, slots=True)
class _Sizes:
    parameters: int
    kept: int
    """Bytes that stay."""
    working: int
    """Bytes of checkpoints and replay memory, gone when the run is done."""


def _sizes(run: PlannedRun) -> _Sizes:
    from msgdrop_cli.algorithms.registry import learner_class
    from msgdrop_envs import registry

    spec = run.spec
    env = registry.make(spec.environment_config, "cpu")
    learner = learner_class(spec.algorithm)([spec.algorithm_config], env, "cpu")
    parameters = sum(tensor.numel() for tensor in learner.policy(0).values())
    capacity = min(
        getattr(spec.algorithm_config, "replay_capacity", 0), spec.training.train_env_steps
    )
    seen = env.observation_size * env.observation_dtype.itemsize
    replay = capacity * env.agents * (seen + 8 + 4 * env.action_size)
    rows = spec.training.train_env_steps // spec.training.log_every_env_steps + 1
    return _Sizes(
        parameters=parameters,
        kept=4 * parameters + rows * _BYTES_A_LOG_ROW,
        working=_CHECKPOINTS * _COPIES * 4 * parameters + replay,
    )


def _rule_of_thumb(parameters: int) -> float:
    """Env steps per second: half of DCC's time does not depend on the size of the networks."""
    return _RULE_STEPS_PER_S * 2.0 / (1.0 + parameters / _RULE_PARAMETERS)


def _measured_speed(run: PlannedRun, finished: Sequence[RunRecord], device: str) -> float | None:
    """Env steps per second of finished runs that had the same work to do; None without any."""
    wanted = _work(spec_to_dict(run.spec))
    speeds = [
        record.env_steps / float(record.run["wall_time_s"])
        for record in finished
        if record.run.get("device") == device
        and float(record.run["wall_time_s"]) > 1.0
        and record.env_steps
        and _work(record.spec) == wanted
    ]
    return median(speeds) if speeds else None


def _work(spec: Mapping[str, Any]) -> Any:
    """The settings that decide how much an env step costs."""
    algorithm = dict(spec["algorithm"])
    keys = ("learner", "network", "batch_size", "update_every_env_steps", "replay_start_env_steps")
    return spec["environment"], [algorithm.get(key) for key in keys]
