"""Runs sorted into arms, and one row of numbers per arm, channel and metric.

An arm is one variant under one set-up: runs that differ in anything but the seed (training length,
profile, an override) never share an arm, whatever their variant is called. Only `done` runs are
measured; failed and diverged ones are counted beside them.
"""

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import chain, groupby
from types import MappingProxyType
from typing import Any, NamedTuple

from msgdrop_cli.analysis.evaluations import Measured, comparable, evaluations_of
from msgdrop_cli.analysis.labels import remarks, shared_overrides
from msgdrop_cli.analysis.metrics import UNKNOWN, Metrics, metrics_of
from msgdrop_cli.analysis.order import in_order
from msgdrop_cli.analysis.provenance import origin
from msgdrop_cli.analysis.rows import Row as Row
from msgdrop_cli.analysis.statistics import root_mean_square
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.definition.spec import TrainingSpec
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.counted import preferred
from msgdrop_cli.records.references import References, game_key
from msgdrop_cli.records.store import RUN, RunRecord

BOOTSTRAP_SEED = 20190127
"""Seed of every bootstrap, so that the same records give the same interval (ours)."""


class Group(NamedTuple):
    """What two arms must share before they may be compared."""

    environment: str
    train_env_steps: int
    profile: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """The runs of one variant under one set-up, and what their evaluations say."""

    group: Group
    variant: str
    label: str
    """For people; names what was overridden of this variant and not of its whole group, and the
    fields that differ where a variant has several set-ups in a group, or another question's arm
    plays another game."""
    overrides: tuple[str, ...]
    """What `--set` changed: `algorithm.gamma=0.9`, `variants.md-0.2.algorithm.rate=0.3`."""
    setup: Mapping[str, Any]
    """The spec of its runs without the seed and without cosmetic fields."""
    done: tuple[RunRecord, ...]
    """Finished runs in order of their seeds."""
    failed: int
    diverged: int
    lost: frozenset[int]
    """Seeds whose run failed or diverged."""
    failed_seeds: frozenset[int]
    """Those of them that failed, which may be trained again."""
    unfinished: int
    """Planned, running or interrupted runs."""
    metrics: Metrics
    """The formulas of its environment, the headline first."""
    rows: tuple[Row, ...]

    def played_with(self, other: "Arm") -> bool:
        """Whether both played one game, or one question sets them apart.

        Two questions may call their scales alike, and set their games otherwise.
        """
        questions = ({run.definition for run in arm.done} for arm in (self, other))
        return self.setup["environment"] == other.setup["environment"] or bool(
            set.intersection(*questions)
        )

    def row(self, metric: str, channel: Channel = NONE_BROKEN) -> Row | None:
        """The row of this metric and channel, or None if nothing was evaluated."""
        wanted = (metric, channel)
        return next((row for row in self.rows if (row.metric, row.channel) == wanted), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """All arms: sorted by group, then in the order that was asked for."""

    arms: tuple[Arm, ...]
    bootstrap_seed: int
    references: Mapping[str, References]
    """What policies that learn nothing get, by `game_key`."""
    left_out: int
    """Evaluations with fewer episodes than are compared, which are in no row."""
    tells_origin: bool = False
    """Whether tables and figures say which runs are published: not in what is to be published."""

    @property
    def groups(self) -> tuple[Group, ...]:
        """Every group once, sorted."""
        return tuple(sorted({arm.group for arm in self.arms}))

    def metrics(self, environment: str) -> Metrics:
        """The formulas of an environment, from the first arm that has been measured."""
        known = [arm.metrics for arm in self.arms if arm.group.environment == environment]
        return next((metrics for metrics in known if metrics is not UNKNOWN), UNKNOWN)

    def arms_of(self, group: Group) -> tuple[Arm, ...]:
        """The arms that may be compared with each other."""
        return tuple(arm for arm in self.arms if arm.group == group)

    def overrides_of(self, group: Group) -> tuple[str, ...]:
        """What `--set` changed of all arms of a group alike, which no label says."""
        return shared_overrides([arm.overrides for arm in self.arms_of(group)])

    def origin_of(self, group: Group) -> str:
        """Which finished runs of a group others have published; empty where nobody is told."""
        done = [record for arm in self.arms_of(group) for record in arm.done]
        return origin(done) if self.tells_origin else ""

    def references_of(self, group: Group) -> References | None:
        """The reference policies of a group's game; None if its arms play by different rules."""
        games = {game_key(arm.setup["environment"]) for arm in self.arms_of(group)}
        return self.references.get(games.pop()) if len(games) == 1 else None

    def to_json(self) -> list[dict[str, Any]]:
        """One flat, JSON-ready table: a line per arm, channel and metric (`--json`)."""
        return [line for arm in self.arms for line in _json_lines(arm)]


def summarise(
    records: Sequence[RunRecord],
    *,
    order: Sequence[str] = (),
    references: Mapping[str, References] = MappingProxyType({}),
    episodes: int | None = None,
    bootstrap_seed: int = BOOTSTRAP_SEED,
) -> Summary:
    """Sort runs into arms and measure them.

    order: variants to put first, in this order (none: as their shipped definition lists them); the
    rest follows by name. references: what is known of the games, by `game_key`. episodes: how many
    of each evaluation count, for all that is compared; None: see `comparable`. A run that is in the
    records twice (published and local) counts once. Raises RecordError for unreadable rows.
    """
    runs: dict[tuple[Group, str, str], list[RunRecord]] = defaultdict(list)
    for record in once_each(records):
        runs[_group(record), record.variant, _setup(record)].append(record)
    arms: list[Arm] = []
    left_out = 0
    for _, group_keys in groupby(in_order(runs, order), key=lambda key: key[0]):
        alike = [_arm(runs[key]) for key in group_keys]
        found = comparable([(arm.done, arm.metrics.all) for arm in alike], episodes)
        left_out += found.left_out
        arms += [
            replace(
                arm,
                label=_label(arm, alike),
                rows=tuple(_rows(arm.metrics, measured, found.episodes, bootstrap_seed)),
            )
            for arm, measured in zip(alike, found.arms, strict=True)
        ]
    return Summary(
        arms=tuple(arms), bootstrap_seed=bootstrap_seed, references=references, left_out=left_out
    )


def check_readable(record: RunRecord) -> None:
    """Read what a summary reads of a run; raises RecordError as `summarise` does."""
    _group(record)
    metrics = metrics_of(record)
    if record.status == "done":
        evaluations_of(record, metrics.all, None)


def once_each(records: Iterable[RunRecord]) -> list[RunRecord]:
    """Each run in each profile once, whatever the number of its copies; by seed."""
    copies: dict[tuple[str, str, str], list[RunRecord]] = {}
    for record in records:
        key = (record.run_id, record.variant, record.profile)
        copies.setdefault(key, []).append(record)
    chosen = (preferred(each)[0] for each in copies.values())
    return sorted(chosen, key=lambda record: (record.seed, record.run_id))


def _group(record: RunRecord) -> Group:
    if record.setup is None:
        raise RecordError(
            f"{record.path / RUN}: spec needs tables environment with a name, algorithm with a"
            " learner, and training with a whole number train_env_steps"
        )
    return Group(record.environment, record.setup.train_env_steps, record.profile)


def _setup(record: RunRecord) -> str:
    """Everything of the spec that can change a result, but the seed: canonical JSON."""
    cosmetic = {field.name for field in fields(TrainingSpec) if field.metadata.get("cosmetic")}
    training = {k: v for k, v in record.spec["training"].items() if k not in cosmetic}
    spec = {k: v for k, v in record.spec.items() if k != "seed"} | {"training": training}
    return json.dumps(spec, sort_keys=True)


def _label(arm: Arm, alike: Sequence[Arm]) -> str:
    shared = shared_overrides([each.overrides for each in alike])
    own = [each for each in arm.overrides if each not in shared]
    setups = [each.setup for each in alike if each.variant == arm.variant]
    others = [each for each in alike if each.done and arm.done and not arm.played_with(each)]
    setups += [{**arm.setup, "environment": each.setup["environment"]} for each in others]
    return arm.label + remarks(arm.variant, own, arm.setup, setups)


def _arm(runs: Sequence[RunRecord]) -> Arm:
    """The runs of one variant under one set-up, neither measured nor told from others."""
    done = tuple(run for run in runs if run.status == "done")
    failed = sum(run.status == "failed" for run in runs)
    diverged = sum(run.status == "diverged" for run in runs)
    overrides = tuple(dict.fromkeys(chain.from_iterable(run.overrides for run in runs)))
    return Arm(
        group=_group(runs[0]),
        variant=runs[0].variant,
        label=runs[0].label,
        overrides=overrides,
        setup=json.loads(_setup(runs[0])),
        done=done,
        failed=failed,
        diverged=diverged,
        lost=frozenset(run.seed for run in runs if run.status in ("failed", "diverged")),
        failed_seeds=frozenset(run.seed for run in runs if run.status == "failed"),
        unfinished=len(runs) - len(done) - failed - diverged,
        metrics=metrics_of((done or runs)[0]),
        rows=(),
    )


def _rows(
    metrics: Metrics, measured: Measured, episodes: int, bootstrap_seed: int
) -> Iterable[Row]:
    for channel in sorted(measured):
        seeds = measured[channel]
        for metric in metrics.all:
            by_seed = {seed: evaluation.values[metric.name] for seed, evaluation in seeds.items()}
            yield Row(
                metric=metric.name,
                channel=channel,
                by_seed=by_seed,
                within=root_mean_square([each.errors[metric.name] for each in seeds.values()]),
                episodes=episodes,
                recorded=max(evaluation.recorded for evaluation in seeds.values()),
                bootstrap_seed=bootstrap_seed,
            )


def _json_lines(arm: Arm) -> Iterable[dict[str, Any]]:
    about = {
        **arm.group._asdict(),
        "variant": arm.variant,
        "label": arm.label,
        "done": len(arm.done),
        "failed": arm.failed,
        "diverged": arm.diverged,
        "unfinished": arm.unfinished,
    }
    for row in arm.rows:
        yield about | {
            **row.channel.entry,
            "metric": row.metric,
            "seeds": len(row.by_seed),
            "by_seed": {str(seed): value for seed, value in row.by_seed.items()},
            "mean": row.mean,
            "iqm": row.iqm,
            "low": row.interval.low if row.interval else None,
            "high": row.interval.high if row.interval else None,
            "within_seed": row.within,
            "between_seeds": row.between,
            "iqm_low": row.iqm_interval.low if row.iqm_interval else None,
            "iqm_high": row.iqm_interval.high if row.iqm_interval else None,
            "episodes": row.episodes,
        }
    if not arm.rows:
        yield about | {"broken_links": None, "metric": None, "seeds": 0}
