"""Copies what stands in records to a mirror, each row once; reads records and changes none."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from msgdrop_cli.analysis.metrics import metrics_of
from msgdrop_cli.definition.channel import NONE_BROKEN
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import read_json, write_json_atomic
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


class Mirroring:
    """What has been copied so far, and copies what is new."""

    def __init__(self, mirror: Mirror, into: Path) -> None:
        """into: the folder of the mirror, where it is noted how far each run has been copied."""
        self._mirror, self._mark = mirror, into / MARK
        self._copied: dict[str, Any] = read_json(self._mark) if self._mark.exists() else {}
        if not isinstance(self._copied, dict):
            raise RecordError(f"{self._mark}: is damaged; remove the folder to copy all again")
        self._seen: dict[str, object] = {}
        """The logs of each run as they were when they were read."""

    def copy(self, records: Sequence[RunRecord]) -> int:
        """Copy what is new in these runs; returns the number of rows."""
        rows = sum(map(self._copy_run, records))
        self._mirror.flush()
        if rows:
            self._mark.parent.mkdir(parents=True, exist_ok=True)
            write_json_atomic(self._mark, self._copied)
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
        copied = self._copied.setdefault(record.run_id, {"env_steps": 0, "episodes": {}})
        # A run that goes on from a checkpoint writes the same rows again: they are there already.
        new = [row for row in record.metrics() if row["env_steps"] > copied["env_steps"]]
        for row in new:
            step = int(row["env_steps"])
            self._mirror.add(record, step, training(row), float(row.get("wall_time_s") or 0.0))
            copied["env_steps"] = step
        evaluated = evaluation(record, copied["episodes"])
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
    if row.get("wall_time_s"):
        values["time/fps"] = row["env_steps"] / row["wall_time_s"]
    return values


def evaluation(record: RunRecord, copied: dict[str, int]) -> dict[str, float]:
    """What each channel that is not in `copied` with so many episodes came to; puts it there."""
    values: dict[str, float] = {}
    for channel, episodes in record.episodes().items():
        if copied.get(channel.key) == len(episodes):
            continue
        through = "" if channel == NONE_BROKEN else f"/{channel.key}"
        for each in metrics_of(record).all:
            name = _EVALUATION.get(each.name, each.name)
            values[f"eval/{name}{through}"] = each.value(episodes)
        copied[channel.key] = len(episodes)
    return values
