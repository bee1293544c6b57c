"""What finished runs did in their evaluations: every metric over raw episodes, channel by channel.

Numbers that are compared come from equally many episodes: the first of each evaluation, by their
numbers.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from msgdrop_cli.analysis.metrics import NamedMetric
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.run_id import short_hash
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.packed import log_file
from msgdrop_cli.records.store import EPISODES, RunRecord


class Evaluation(NamedTuple):
    """One run under one channel."""

    recorded: int
    """Episodes in the record."""
    values: Mapping[str, float]
    """Each metric, over as many of them as are compared."""
    errors: Mapping[str, float | None]
    """The standard error of each over these episodes; None for a single one."""


Measured = dict[Channel, dict[int, Evaluation]]
"""The evaluations of one arm: channel, then seed."""


class Comparable(NamedTuple):
    """The evaluations of arms that stand side by side."""

    arms: list[Measured]
    episodes: int
    """Of each evaluation; 0 without any."""
    left_out: int
    """Evaluations with fewer episodes, which are in no arm."""


def comparable(
    arms: Sequence[tuple[Sequence[RunRecord], Sequence[NamedMetric]]], episodes: int | None
) -> Comparable:
    """Measure the finished runs of each arm over the first `episodes` of each evaluation.

    None: as many as every run has of its first channel, so that a short look at another one takes
    nothing from the main numbers. Raises RecordError for unreadable rows.
    """
    measured = [_measured(runs, metrics, episodes) for runs, metrics in arms]
    if episodes is None:
        episodes = min(
            (each.recorded for arm in measured if arm for each in arm[min(arm)].values()), default=0
        )
        measured = [
            _measured(runs, metrics, episodes) if _most(arm) > episodes else arm
            for arm, (runs, metrics) in zip(measured, arms, strict=True)
        ]
    kept = [_with(episodes, arm) for arm in measured]
    return Comparable(arms=kept, episodes=episodes, left_out=_count(measured) - _count(kept))


def _measured(
    runs: Sequence[RunRecord], metrics: Sequence[NamedMetric], episodes: int | None
) -> Measured:
    measured: Measured = defaultdict(dict)
    for record in runs:
        for channel, evaluation in evaluations_of(record, metrics, episodes).items():
            measured[channel][record.seed] = evaluation
    return measured


def _most(arm: Measured) -> int:
    return max((each.recorded for seeds in arm.values() for each in seeds.values()), default=0)


def _with(episodes: int, arm: Measured) -> Measured:
    """The evaluations that have as many episodes."""
    enough = {
        channel: {seed: each for seed, each in seeds.items() if each.recorded >= episodes}
        for channel, seeds in arm.items()
    }
    return {channel: seeds for channel, seeds in enough.items() if seeds}


def _count(arms: Sequence[Measured]) -> int:
    return sum(len(seeds) for arm in arms for seeds in arm.values())


def evaluations_of(
    record: RunRecord, metrics: Sequence[NamedMetric], episodes: int | None
) -> dict[Channel, Evaluation]:
    """Each channel of one run, over its first `episodes` (None: all)."""
    name = f"evaluations {_formulas(tuple(metrics))} {episodes}"
    found = record.derive(name, lambda: _evaluated(record, metrics, episodes))
    return {_channel(entry): Evaluation(*evaluation) for entry, *evaluation in found}


def _evaluated(
    record: RunRecord, metrics: Sequence[NamedMetric], episodes: int | None
) -> list[tuple[Any, ...]]:
    """What each channel is called in a log, and the fields of its Evaluation."""
    played = record.episodes()
    try:
        for rows in played.values():
            rows.sort(key=lambda row: row["episode"])
        return [
            (
                *channel.entry.values(),
                len(rows),
                {each.name: each.value(rows[:episodes]) for each in metrics},
                {each.name: each.standard_error(rows[:episodes]) for each in metrics},
            )
            for channel, rows in played.items()
        ]
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        raise RecordError(
            f"{log_file(record.path / EPISODES)}: an episode's row is not readable ({error!r}); "
            "evaluate this run again"
        ) from error


@lru_cache(maxsize=64)  # thousands of runs, a few games
def _formulas(metrics: tuple[NamedMetric, ...]) -> str:
    return short_hash({"metrics": repr(metrics)})


@lru_cache(maxsize=1_024)  # thousands of runs, a few channels
def _channel(entry: str | float) -> Channel:
    return Channel.read(entry)
