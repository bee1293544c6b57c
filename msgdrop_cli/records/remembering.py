"""Which runs keep what is computed of their logs: those of who asks for it, and no others."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from msgdrop_cli.records.derived import Derived
from msgdrop_cli.records.store import EPISODES, METRICS, RunRecord
from msgdrop_cli.records.sums import SUMS


def remembering(records: Iterable[RunRecord], home: Path) -> list[RunRecord]:
    """The same runs; what is computed of them is kept in the results folder `home`.

    Nothing is kept of a run that lies in none: `home` is its own folder then, or a published study
    that has been copied, of which every file is listed.
    """
    logs = (METRICS, EPISODES)
    if (home / SUMS).exists():
        return [*records]
    return [
        record if record.path == home else replace(record, derived=Derived(home, record.path, logs))
        for record in records
    ]
