"""Two runs, or all runs of two variants, side by side: what differs, and by how much."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from msgdrop_cli.analysis.curves import Curve, difference_of, learning_curve
from msgdrop_cli.analysis.evaluations import comparable
from msgdrop_cli.analysis.intervals import mean_interval
from msgdrop_cli.analysis.labels import leaves
from msgdrop_cli.analysis.metrics import metrics_of
from msgdrop_cli.analysis.statistics import Interval, mean
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.records.store import RunRecord

_MADE_WITH = ("commit", "host", "device", "threads", "kernel")


class Differing(NamedTuple):
    """A fact of which the two sides say different things."""

    name: str
    one: tuple[Any, ...]
    other: tuple[Any, ...]
    """All that its runs say, each value once, sorted as words."""


class Difference(NamedTuple):
    """Of one metric through one channel: the second side minus the first."""

    channel: Channel
    metric: str
    mean: float
    interval: Interval | None
    """95% inverted sign-flips; lowest to highest below six pairs, None for one."""
    pairs: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Everything that `compare` finds."""

    settings: tuple[Differing, ...]
    made_with: tuple[Differing, ...]
    """Commits, machines, versions."""
    metric: str
    curve: Curve | None
    """Of the headline while training: second minus first; None without common seeds."""
    evaluations: tuple[Difference, ...]
    episodes: int
    """Of each evaluation: as many as both sides have."""

    @property
    def largest(self) -> tuple[int, float] | None:
        """Where the mean curves differ most, in env steps, and by how much."""
        if self.curve is None:
            return None
        points = zip(self.curve.env_steps, self.curve.mean, strict=True)
        return max(points, key=lambda point: abs(point[1]))


def compare(one: Sequence[RunRecord], other: Sequence[RunRecord]) -> Comparison:
    """Compare runs that share a seed, pair by pair; one run a side is a pair whatever its seed.

    Raises RecordError for unreadable rows.
    """
    metrics = metrics_of(one[0])
    done = [[run for run in side if run.status == "done"] for side in (one, other)]
    known = {metric.name for metric in metrics_of(other[0]).all}
    common = [metric for metric in metrics.all if metric.name in known]
    found = comparable([(side, common) for side in done], None)
    single = all(len(side) == 1 for side in done)
    evaluations = []
    for channel in sorted(found.arms[0].keys() & found.arms[1].keys()):
        first, second = (
            {0 if single else seed: each.values for seed, each in arm[channel].items()}
            for arm in found.arms
        )
        seeds = sorted(first.keys() & second.keys())
        for metric in common if seeds else ():
            values = [second[seed][metric.name] - first[seed][metric.name] for seed in seeds]
            evaluations.append(
                Difference(channel, metric.name, mean(values), mean_interval(values), len(values))
            )
    return Comparison(
        settings=_differing(one, other, lambda run: dict(leaves(_setup(run)))),
        made_with=_differing(one, other, _facts),
        metric=metrics.headline.name,
        curve=_curve(done, metrics.headline.name, single),
        evaluations=tuple(evaluations),
        episodes=found.episodes,
    )


def _curve(done: Sequence[Sequence[RunRecord]], metric: str, single: bool) -> Curve | None:
    first, second = (learning_curve(side, metric) for side in done)
    if first is None or second is None:
        return None
    if single:
        first, second = (replace(each, by_seed={0: each.mean}) for each in (first, second))
    return difference_of(second, first)


def _setup(record: RunRecord) -> dict[str, Any]:
    return {key: value for key, value in record.spec.items() if key != "seed"}


def _facts(record: RunRecord) -> dict[str, Any]:
    versions = record.run.get("versions") or {}
    return {**{name: record.run.get(name) for name in _MADE_WITH}, **versions}


def _differing(
    one: Sequence[RunRecord], other: Sequence[RunRecord], facts: Any
) -> tuple[Differing, ...]:
    """What the sides do not say alike, in the order of the facts."""
    sides = [[facts(run) for run in side] for side in (one, other)]
    names = dict.fromkeys(name for side in sides for each in side for name in each)
    rows = [Differing(name, *(_said(side, name) for side in sides)) for name in names]
    # As words: True and 1 are equal, and not alike.
    return tuple(row for row in rows if in_words(row.one) != in_words(row.other))


def _said(side: Sequence[dict[str, Any]], name: str) -> tuple[Any, ...]:
    said = {str(each[name]): each[name] for each in side if each.get(name) is not None}
    return tuple(said[words] for words in sorted(said))


def in_words(values: Sequence[Any]) -> str:
    """What a side says of a fact; `-` for nothing."""
    return ", ".join(map(str, values)) or "-"
