"""Copies what stands in records to a mirror, each row once; reads records and changes none."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from msgdrop_cli.analysis.evaluations import evaluations_of
from msgdrop_cli.analysis.metrics import metrics_of
from msgdrop_cli.definition.channel import NONE_BROKEN
from msgdrop_cli.definition.strict import Where, convert
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.files import read_json, write_json_atomic
from msgdrop_cli.records.ours import refuse_links
from msgdrop_cli.records.packed import log_file
from msgdrop_cli.records.store import EPISODES, METRICS, RunRecord
from msgdrop_cli.report.mirrors import Mirror

MARK = "mirrored.json"
"""How far each run has been copied: env steps, and episodes of each channel."""
_TRAINING = {
    "loss": "train/loss",
    "q": "train/q_values",
    "epsilon": "rollout/exploration_rate",
    "wall_time_s": "time/time_elapsed",
}
"""As Stable-Baselines3 calls them; all others are those of the rollout."""
_ROLLOUT = {
    "return_per_episode": "ep_rew_mean",
    "steps_to_finish": "ep_len_mean",
    "capture_rate": "success_rate",
}
_EVALUATION = {
    "return_per_episode": "mean_reward",
    "steps_to_finish": "mean_ep_length",
    "capture_rate": "success_rate",
}


@dataclass(slots=True)
class _Copied:
    """How far a run has been copied."""

    env_steps: int = 0
    episodes: dict[str, int] = field(default_factory=dict)
    """Of each channel by its key."""


class Mirroring:
    """What has been copied so far, and copies what is new."""

    def __init__(self, mirror: Mirror, into: Path) -> None:
        """into: the folder of the mirror, where it is noted how far each run has been copied."""
        self._mirror, self._into, self._mark = mirror, into, into / MARK
        said = read_json(self._mark) if self._mark.exists() else {}
        try:
            self._copied = convert(said, dict[str, _Copied], Where(str(self._mark)))
        except DefinitionError as error:
            raise RecordError(f"{error}; remove the folder to copy all again") from error
        self._seen: dict[str, object] = {}
        """The logs of each run as they were when they were read."""

    def copy(self, records: Sequence[RunRecord]) -> int:
        """Copy what is new in these runs; returns the number of rows."""
        rows = sum(map(self._copy_run, records))
        self._mirror.flush()
        if rows:
            self._mark.parent.mkdir(parents=True, exist_ok=True)
            write_json_atomic(self._mark, {run: asdict(far) for run, far in self._copied.items()})
        return rows

    def close(self, records: Sequence[RunRecord]) -> None:
        """Nothing more is to come of these."""
        for record in records:
            self._mirror.close(record)

    def _copy_run(self, record: RunRecord) -> int:
        logs = [log_file(record.path / name) for name in (METRICS, EPISODES)]
        seen = [(log.stat().st_size, log.stat().st_mtime_ns) for log in logs if log.exists()]
        if self._seen.get(record.run_id) == seen:
            return 0
        self._seen[record.run_id] = seen
        refuse_links(self._into, self._into / record.environment / record.path.name)
        copied = self._copied.setdefault(record.run_id, _Copied())
        # A run that goes on from a checkpoint writes the same rows again: they are there already.
        new = [row for row in record.metrics() if row["env_steps"] > copied.env_steps]
        for row in new:
            step = int(row["env_steps"])
            self._mirror.add(record, step, training(row), _seconds(row))
            copied.env_steps = step
        evaluated = evaluation(record, copied.episodes)
        if evaluated:
            wall_time_s = float(record.run["wall_time_s"])
            self._mirror.add(record, record.env_steps, evaluated, wall_time_s)
        return len(new) + bool(evaluated)


def training(row: Mapping[str, Any]) -> dict[str, float]:
    """A row of `metrics.jsonl` under the names of the field; what is null is left out."""
    values = {
        _TRAINING.get(name) or f"rollout/{_ROLLOUT.get(name, name)}": float(value)
        for name, value in row.items()
        if name != "env_steps" and isinstance(value, int | float)
    }
    if _seconds(row):
        values["time/fps"] = row["env_steps"] / _seconds(row)
    return values


def _seconds(row: Mapping[str, Any]) -> float:
    """How long it had been trained, as far as the row says it."""
    said = row.get("wall_time_s")
    return float(said) if isinstance(said, int | float) else 0.0


def evaluation(record: RunRecord, copied: dict[str, int]) -> dict[str, float]:
    """What each channel that is not in `copied` with so many episodes came to; puts it there."""
    values: dict[str, float] = {}
    metrics = metrics_of(record).all
    for channel, played in evaluations_of(record, metrics, None).items():
        if copied.get(channel.key) == played.recorded:
            continue
        through = "" if channel == NONE_BROKEN else f"/{channel.key}"
        for name, value in played.values.items():
            values[f"eval/{_EVALUATION.get(name, name)}{through}"] = value
        copied[channel.key] = played.recorded
    return values
