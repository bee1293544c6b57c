"""Records as tidy tables for other programs: columns of plain values, a row for each observation.

A run that lies in several places (published and local) is there once for each question that has it.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

from msgdrop_cli.analysis.evaluations import evaluations_of
from msgdrop_cli.analysis.metrics import metrics_of
from msgdrop_cli.analysis.summary import once_each
from msgdrop_cli.records.store import RunRecord

Columns = dict[str, list[Any]]
"""Every column has a value for each row; None where there is nothing."""


def results_table(records: Sequence[RunRecord]) -> Columns:
    """One row for each run and channel that it was evaluated through, of all recorded episodes.

    Runs without an evaluation have one row without a channel, so that failed ones are not lost.
    A metric of another environment is None. Raises RecordError for unreadable rows.
    """
    return _columns(row for record in _sorted(records) for row in _results(record))


def curves_table(records: Sequence[RunRecord]) -> Columns:
    """One row for each run and window of its training: what the exploring policy did in it.

    Nothing is smoothed. Raises RecordError for unreadable rows.
    """
    return _columns(
        {**_who(record), **window} for record in _sorted(records) for window in record.metrics()
    )


def _sorted(records: Sequence[RunRecord]) -> list[RunRecord]:
    """Each run once under every question's name for it, beside those that it is compared with."""
    asked: dict[str, list[RunRecord]] = {}
    for record in records:
        asked.setdefault(record.definition, []).append(record)
    return sorted(
        chain.from_iterable(map(once_each, asked.values())),
        key=lambda run: (run.definition, run.profile, run.environment, run.variant, run.seed),
    )


def _who(record: RunRecord) -> dict[str, Any]:
    """What a run is known by."""
    return {
        "run_id": record.run_id,
        "question": record.definition,
        "variant": record.variant,
        "label": record.label,
        "environment": record.environment,
        "profile": record.profile,
        "seed": record.seed,
    }


def _results(record: RunRecord) -> Iterable[Mapping[str, Any]]:
    run, versions = record.run, record.run.get("versions") or {}
    about = {
        **_who(record),
        "status": record.status,
        "reason": record.reason,
        "train_env_steps": record.setup.train_env_steps if record.setup else None,
        "env_steps": record.env_steps,
        "overrides": ", ".join(record.overrides),
        "registration": record.registration,
        "commit": run.get("commit"),
        "machine": run.get("host"),
        "device": run.get("device"),
        "threads": run.get("threads"),
        "kernel": run.get("kernel"),
        "torch": versions.get("torch"),
        "created": run.get("created"),
        "wall_time_s": float(run["wall_time_s"]),
        "path": str(record.path),
        "channel": None,
        "episodes": None,
    }
    found = evaluations_of(record, metrics_of(record).all, None)
    for channel in sorted(found):
        evaluation = found[channel]
        yield {
            **about,
            "channel": channel.key,
            "episodes": evaluation.recorded,
            **evaluation.values,
        }
    if not found:
        yield about


def _columns(rows: Iterable[Mapping[str, Any]]) -> Columns:
    """Rows as columns; a column that a row has not is None there."""
    found = list(rows)
    names = dict.fromkeys(name for row in found for name in row)
    return {name: [row.get(name) for row in found] for name in names}
