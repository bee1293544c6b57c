"""What is measured in an evaluation: formulas that every record brings along from its environment.

A metric is a ratio of sums over raw episodes (rows of `episodes.jsonl`), no mean of ratios, so
that a long episode weighs what it lasts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from msgdrop_cli.definition.strict import Where, build, shown
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.parsing import LARGEST_NUMBER
from msgdrop_cli.records.store import RUN, RunRecord

_MOST_METRICS = 32
"""Of a record; our games have 5."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """`scale` x (sum of `count` over episodes) / (sum of `per`); as the environment declares it."""

    name: str
    """Its key in `metrics.jsonl`, in claims and in JSON output."""
    count: str
    """Key of the episode rows that is summed above the line."""
    per: str
    """Key that is summed below the line; `episodes` counts them."""
    scale: float
    better: Literal["higher", "lower"]
    meaning: str

    @property
    def label(self) -> str:
        """What people read on an axis or over a column."""
        return self.name.replace("_", " ")

    @property
    def formula(self) -> str:
        """The formula in words, for captions."""
        factor = "" if self.scale == 1.0 else f"{self.scale:g} x "
        return f"{factor}{self.count} / {self.per} ({self.meaning})"

    @property
    def higher_is_better(self) -> bool:
        """Whether more of it is what the agents want."""
        return self.better == "higher"

    def value(self, episodes: Sequence[Mapping[str, Any]]) -> float:
        """The metric over these episodes.

        Raises KeyError, TypeError, ValueError or ZeroDivisionError on rows of another environment.
        """
        total = sum(row[self.count] for row in episodes)
        below = len(episodes) if self.per == "episodes" else sum(row[self.per] for row in episodes)
        value = self.scale * float(total) / float(below)
        if not abs(value) <= LARGEST_NUMBER:  # nor NaN
            raise ValueError(f"{self.name} is beyond {LARGEST_NUMBER:g}")
        return value


@dataclass(frozen=True, slots=True)
class Metrics:
    """The metrics of one environment; the first is the headline."""

    all: tuple[Metric, ...]

    @property
    def headline(self) -> Metric:
        """The one metric that learning curves and first columns show."""
        return self.all[0]

    def find(self, name: str) -> Metric | None:
        """The metric of this name, or None."""
        return next((metric for metric in self.all if metric.name == name), None)


UNKNOWN = Metrics(
    (
        Metric(
            name="return_per_episode",
            count="return",
            per="episodes",
            scale=1.0,
            better="higher",
            meaning="reward summed over agents and steps",
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
        if not isinstance(table, dict):
            raise where.error(f"expected a table, not {shown(table)}")
        if len(table) > _MOST_METRICS:
            raise where.error(f"expected {_MOST_METRICS} metrics at most, not {len(table):,}")
        return Metrics(tuple(_metric(name, row, where.at(name)) for name, row in table.items()))
    except DefinitionError as error:
        raise RecordError(str(error)) from error


def _metric(name: str, row: Any, where: Where) -> Metric:
    if not isinstance(row, dict):
        raise where.error(f"expected a table, not {shown(row)}")
    return build(Metric, {**row, "name": name}, where)
