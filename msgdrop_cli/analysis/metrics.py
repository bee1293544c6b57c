"""What is measured in an evaluation: formulas that every record brings along from its environment.

A metric is a ratio of sums over raw episodes (rows of `episodes.jsonl`), no mean of ratios, so
that a long episode weighs what it lasts.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from msgdrop_cli.analysis.statistics import total
from msgdrop_cli.definition.strict import Where, build, convert
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.parsing import LARGEST_NUMBER
from msgdrop_cli.records.store import RUN, RunRecord
from msgdrop_envs.metric import Metric

_MOST_METRICS = 32
"""Of a record; our games have 5."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedMetric:
    """A formula as the environment declares it, and what it is called."""

    name: str
    """Its key in `metrics.jsonl`, in claims and in JSON output."""
    metric: Metric

    @property
    def label(self) -> str:
        """What people read on an axis or over a column."""
        return self.name.replace("_", " ")

    @property
    def formula(self) -> str:
        """The formula in words, for captions."""
        metric = self.metric
        factor = "" if metric.scale == 1.0 else f"{metric.scale:g} x "
        return f"{factor}{metric.count} / {metric.per} ({metric.meaning})"

    @property
    def higher_is_better(self) -> bool:
        """Whether more of it is what the agents want."""
        return self.metric.better == "higher"

    def value(self, episodes: Sequence[Mapping[str, Any]]) -> float:
        """The metric over these episodes.

        Raises KeyError, TypeError or ValueError on rows of another environment.
        """
        sums = {"episodes": float(len(episodes))}
        for key in {self.metric.count, self.metric.per} - {"episodes"}:
            sums[key] = total([row[key] for row in episodes])
        value = self.metric.ratio(sums)
        if value is None or not abs(value) <= LARGEST_NUMBER:  # nor NaN
            raise ValueError(f"{self.name} is none, or beyond {LARGEST_NUMBER:g}")
        return value

    def standard_error(self, episodes: Sequence[Mapping[str, Any]]) -> float | None:
        """How far the value over these episodes is from that over endlessly many, as a rule.

        Of a ratio of sums, so of what each episode's count differs from the ratio times its length
        (the delta method; per episode it is the standard error of the mean). None for one episode.
        Raises as `value`, and ValueError where episodes differ too much.
        """
        number, ratio = len(episodes), self.value(episodes) / self.metric.scale
        if number < 2:
            return None
        per = [1.0 if self.metric.per == "episodes" else row[self.metric.per] for row in episodes]
        rest = [
            row[self.metric.count] - ratio * each for row, each in zip(episodes, per, strict=True)
        ]
        squares = total([each * each for each in rest]) * number / (number - 1)
        found = abs(self.metric.scale) * math.sqrt(squares) / total(per)
        if not found <= LARGEST_NUMBER:  # nor NaN
            raise ValueError(f"the error of {self.name} is beyond {LARGEST_NUMBER:g}")
        return found


@dataclass(frozen=True, slots=True)
class Metrics:
    """The metrics of one environment; the first is the headline."""

    all: tuple[NamedMetric, ...]

    @property
    def headline(self) -> NamedMetric:
        """The one metric that learning curves and first columns show."""
        return self.all[0]

    def find(self, name: str) -> NamedMetric | None:
        """The metric of this name, or None."""
        return next((metric for metric in self.all if metric.name == name), None)


UNKNOWN = Metrics(
    (
        NamedMetric(
            name="return_per_episode",
            metric=Metric(
                count="return",
                per="episodes",
                scale=1.0,
                better="higher",
                meaning="reward summed over agents and steps",
            ),
        ),
    )
)
"""For runs that never began: they have no formulas yet, and nothing to measure."""


def metrics_of(record: RunRecord) -> Metrics:
    """The formulas in a run's record; RecordError if they are not readable."""
    table = record.run.get("metrics")
    if not table:
        return UNKNOWN
    where = Where(str(record.path / RUN)).at("metrics")
    try:
        rows = convert(table, Mapping[str, Any], where)
        if len(rows) > _MOST_METRICS:
            raise where.error(f"expected {_MOST_METRICS} metrics at most, not {len(rows):,}")
        return Metrics(
            tuple(
                NamedMetric(
                    name=convert(name, str, where.at(name)),
                    metric=build(Metric, row, where.at(name)),
                )
                for name, row in rows.items()
            )
        )
    except DefinitionError as error:
        raise RecordError(str(error)) from error
