"""Which runs keep what is computed of their logs, and where."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from msgdrop_cli.records.derived import Derived
from msgdrop_cli.records.store import EPISODES, METRICS, RunRecord
from msgdrop_cli.records.sums import SUMS


def remembering(records: Iterable[RunRecord], home: Path | None) -> list[RunRecord]:
    """The same runs; what is computed of them is kept in the results folder `home`.

    It is kept in memory alone for who has none (None), and of a run that lies in none: `home` is
    its own folder then, or in a published study that was copied, of which every file is listed.
    """
    logs = (METRICS, EPISODES)
    if home and any((each / SUMS).exists() for each in (home, *home.resolve().parents[:2])):
        home = None
    return [
        replace(record, derived=Derived(None if record.path == home else home, record.path, logs))
        for record in records
    ]
