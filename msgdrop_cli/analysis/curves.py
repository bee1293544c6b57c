"""Learning curves from the windows of `metrics.jsonl`, for runs that are done.

A window says what the acting (exploring) policy did in training since the row before it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from msgdrop_cli.analysis.intervals import mean_band
from msgdrop_cli.analysis.statistics import Interval, mean, total
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.packed import log_file
from msgdrop_cli.records.parsing import LARGEST_NUMBER
from msgdrop_cli.records.store import METRICS, RunRecord

SMOOTHING_SHARE = 0.05
"""Width of the moving mean as a share of the run's env steps."""


@dataclass(frozen=True, kw_only=True)
class Curve:
    """The seeds' smoothed curves of one arm on their common grid; every list is [points].

    Of many curves few estimates are asked, so each is made when it is asked for, and once.
    """

    env_steps: list[int]
    by_seed: Mapping[int, list[float]]

    @cached_property
    def mean(self) -> list[float]:
        """The mean over seeds."""
        return [mean(column) for column in zip(*self.by_seed.values(), strict=True)]

    @cached_property
    def band(self) -> list[Interval] | None:
        """95% sign-flip interval of the mean; below six seeds lowest to highest, None for one."""
        return mean_band(list(self.by_seed.values()))


class Points(NamedTuple):
    """The smoothed curve of one run; both lists are [points]."""

    env_steps: list[int]
    values: list[float]


class Window(NamedTuple):
    """One row of the log that has a value."""

    env_steps: int
    """Env steps of the run at the window's end."""
    length: int
    """Env steps in the window: its weight in every mean."""
    value: float


def learning_curve(records: Sequence[RunRecord], metric: str) -> Curve | None:
    """The curves of one arm's runs; None when no env step is common to all seeds.

    metric: a key of `metrics.jsonl`.
    """
    smoothed = {record.seed: smooth_curve(record, metric) for record in records}
    grids = {tuple(each.env_steps) for each in smoothed.values()}  # hundreds of seeds, one grid
    grid = sorted(set.intersection(*map(set, grids))) if grids else []
    if not grid:
        return None
    by_seed = {seed: _at(grid, points) for seed, points in smoothed.items()}
    return Curve(env_steps=grid, by_seed=by_seed)


def difference_of(better: Curve, worse: Curve, sign: float = 1.0) -> Curve | None:
    """The first curve minus the second, seed by seed; None without a common seed or env step."""
    seeds = [seed for seed in better.by_seed if seed in worse.by_seed]
    grid = sorted({*better.env_steps} & {*worse.env_steps})
    if not seeds or not grid:
        return None
    by_seed = {}
    for seed in seeds:
        one, other = (
            _at(grid, Points(each.env_steps, each.by_seed[seed])) for each in (better, worse)
        )
        by_seed[seed] = [sign * (a - b) for a, b in zip(one, other, strict=True)]
    return Curve(env_steps=grid, by_seed=by_seed)


def _at(grid: Sequence[int], points: Points) -> list[float]:
    """The values at these env steps, which are among the points'."""
    if len(grid) == len(points.env_steps):
        return points.values
    by_step = dict(zip(*points, strict=True))
    return [by_step[step] for step in grid]


def learning_mean(record: RunRecord, metric: str) -> float | None:
    """The mean of the metric over the whole training of one run: high for who learns early.

    Windows weigh their env steps, so a per-step rate such as catches per 500 is exact. None when
    the log has no value of this metric.
    """
    found: float | None = _learning(record, metric)[0]
    return found


def smooth_curve(record: RunRecord, metric: str) -> Points:
    """The metric of one run, in a centred moving mean over SMOOTHING_SHARE of it."""
    return Points(*_learning(record, metric)[1])


def _learning(record: RunRecord, metric: str) -> Sequence[Any]:
    """Mean and curve, of one reading of the log."""

    def make() -> tuple[float | None, Points]:
        windows = windows_of(record, metric)
        return _learning_mean(windows), _smooth(windows)

    found: Sequence[Any] = record.derive(f"learning {metric}", make)
    return found


def _learning_mean(windows: Sequence[Window]) -> float | None:
    return _weighted_mean(windows) if windows else None


def windows_of(record: RunRecord, metric: str) -> list[Window]:
    """The windows with a value, in order; a null (nothing happened to be measured) is left out.

    Raises RecordError for a row that is none, or not the one that follows the row before; of a
    finished run also for a log that ends too early.
    """
    windows, start = [], 0
    try:
        for row in record.metrics():
            end, value = int(row["env_steps"]), row.get(metric)
            if end <= start or end > _next_row(record, start):
                raise RecordError(
                    f"{log_file(record.path / METRICS)}: env_steps {end} does not follow {start}"
                )
            if value is not None and abs(value) > LARGEST_NUMBER:
                raise ValueError(f"beyond {LARGEST_NUMBER:g}")
            if value is not None:
                windows.append(Window(end, end - start, float(value)))
            start = end
    except (KeyError, TypeError, ValueError) as error:
        raise RecordError(
            f"{log_file(record.path / METRICS)}: env_steps or {metric} is not a number ({error!r})"
        ) from error
    if record.status == "done" and start != record.env_steps:
        file = log_file(record.path / METRICS)
        raise RecordError(f"{file}: does not end with env_steps {record.env_steps}")
    return windows


def _next_row(record: RunRecord, start: int) -> int:
    """The env steps at which the row after `start` was written: passing a multiple, or the end."""
    training = record.spec["training"]
    every, games = int(training["log_every_env_steps"]), int(training["games"])
    return -(-(start // every + 1) * every // games) * games


def _smooth(windows: Sequence[Window]) -> Points:
    """Centred moving mean over SMOOTHING_SHARE of the run, narrower at both ends."""
    smoothed = Points([], [])
    reach = SMOOTHING_SHARE * windows[-1].env_steps / 2.0 if windows else 0.0
    first, last = 0, 0
    for window in windows:
        while windows[first].env_steps < window.env_steps - reach:
            first += 1
        while last < len(windows) and windows[last].env_steps <= window.env_steps + reach:
            last += 1
        smoothed.env_steps.append(window.env_steps)
        smoothed.values.append(_weighted_mean(windows[first:last]))
    return smoothed


def _weighted_mean(windows: Sequence[Window]) -> float:
    weight = sum(window.length for window in windows)
    return total([window.length * window.value for window in windows]) / weight
