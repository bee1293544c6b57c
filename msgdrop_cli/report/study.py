"""Finished runs as small records that can be committed: numbers of all, one policy a variant."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from msgdrop_cli.analysis.summary import Summary
from msgdrop_cli.analysis.verdict import Verdict
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import CANNOT_WRITE, TEMPORARY, write_json_atomic
from msgdrop_cli.records.packed import log_bytes, pack, packed_name
from msgdrop_cli.records.store import EPISODES, METRICS, POLICY, RUN, RunRecord
from msgdrop_cli.report.table import channels_table, claims_table, results_table, to_markdown
from msgdrop_cli.report.write import Folder


def publish(records: Sequence[RunRecord], folder: Folder) -> list[Path]:
    """Copy finished runs below a folder: their numbers, packed, and each lowest seed's policy.

    A run that stands there already is replaced as a whole. Returns the copies' paths.
    Raises RecordError, damaged (2) or not writable (73, 74), with nothing half-copied.
    """
    lowest: dict[tuple[str, str], int] = {}
    for record in records:
        arm = (record.environment, record.variant)
        lowest[arm] = min(record.seed, lowest.get(arm, record.seed))
    copies = []
    for record in records:
        with_policy = record.seed == lowest[record.environment, record.variant]
        target = folder.at(record.environment).made() / record.path.name
        _copy(record, target, with_policy)
        copies.append(target)
    return copies


def tables(summary: Summary, verdicts: Sequence[Verdict]) -> str:
    """Every table of a summary as one Markdown page."""
    pages = []
    for group in summary.groups:
        pages.append(results_table(summary, group))
        if len({row.channel for arm in summary.arms_of(group) for row in arm.rows}) > 1:
            pages.append(channels_table(summary, group))
    if verdicts:
        pages.append(claims_table(verdicts))
    return "\n".join(to_markdown(page) for page in pages)


def _copy(record: RunRecord, target: Path, with_policy: bool) -> None:
    try:
        with TemporaryDirectory(dir=target.parent, prefix=TEMPORARY) as scratch:
            copy = Path(scratch) / target.name
            copy.mkdir()
            write_json_atomic(copy / RUN, record.run)  # by the names of the question it answers
            for log in (METRICS, EPISODES):
                if (content := log_bytes(record.path / log)) is not None:
                    (copy / packed_name(log)).write_bytes(pack(content))
            if with_policy and (record.path / POLICY).exists():
                shutil.copyfile(record.path / POLICY, copy / POLICY)
            if os.path.lexists(target):
                target.rename(Path(scratch) / "old")
            copy.rename(target)
    except OSError as error:
        raise RecordError(f"{target}: cannot be written: {error.strerror}", CANNOT_WRITE) from error
