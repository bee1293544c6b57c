"""Finished runs as small copies that can be committed: numbers of all, one policy a variant."""

from collections.abc import Sequence
from os.path import lexists
from pathlib import Path

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import CANNOT_WRITE, read_bytes, write_json_atomic
from msgdrop_cli.records.packed import log_bytes, pack, packed_name
from msgdrop_cli.records.store import EPISODES, METRICS, POLICY, RUN, RunRecord, list_runs
from msgdrop_cli.records.temporary import TEMPORARY, put_in_place
from msgdrop_cli.signals import scratch_folder

FILES = (RUN, packed_name(METRICS), packed_name(EPISODES), POLICY)
"""What may lie in the folder of a copy."""


def with_policy(records: Sequence[RunRecord]) -> set[str]:
    """The ids of the runs whose policy goes along: each variant's lowest seed in each game."""
    lowest: dict[tuple[str, str], RunRecord] = {}
    for record in records:
        arm = (record.environment, record.variant)
        lowest[arm] = min(record, lowest.get(arm, record), key=lambda each: each.seed)
    return {record.run_id for record in lowest.values()}


def is_copied(record: RunRecord, target: Path, *, policy: bool) -> bool:
    """Whether a copy of this very run lies there, and nothing else; its policy may be missing.

    policy: whether it may have one, which is the run's if that has one. What is damaged is none.
    """
    kept = target / POLICY
    try:
        [copy] = list_runs(target) if (target / RUN).is_file() else [None]
        return (
            copy is not None
            and copy.run == record.run
            and same_logs(copy, record)
            and {path.name for path in target.iterdir()} <= {*FILES}
            and (not lexists(kept) or (policy and _is_policy_of(record, read_bytes(kept))))
        )
    except (RecordError, OSError):
        return False  # who copies the run once more says what is wrong with it


def same_logs(one: RunRecord, other: RunRecord) -> bool:
    """Whether two copies of a run have the same numbers; RecordError if a log is damaged."""
    return all(
        log_bytes(one.path / log) == log_bytes(other.path / log) for log in (METRICS, EPISODES)
    )


def _is_policy_of(record: RunRecord, content: bytes) -> bool:
    """Whether it is the run's, or the run has lost its own."""
    own = record.path / POLICY
    return not lexists(own) or read_bytes(own) == content


def _policy(record: RunRecord, target: Path) -> bytes | None:
    """The run's own, or the one that a copy of the same training has kept."""
    if lexists(record.path / POLICY):
        return read_bytes(record.path / POLICY)
    same = log_bytes(record.path / METRICS) == log_bytes(target / METRICS)
    return read_bytes(target / POLICY) if same and lexists(target / POLICY) else None


def copy_run(record: RunRecord, target: Path, *, policy: bool) -> None:
    """Copy a run's numbers, packed, and its policy if that is asked for and there.

    What stands at `target` is replaced as a whole; a policy that the run has lost and a copy of the
    same training has kept there stays. No link is followed. Raises RecordError, damaged (2) or not
    writable (74), with nothing half-copied.
    """
    try:
        with scratch_folder(target.parent, TEMPORARY) as scratch:
            copy = scratch / target.name
            copy.mkdir()
            write_json_atomic(copy / RUN, record.run)  # by the names of the question it answers
            for log in (METRICS, EPISODES):
                if (content := log_bytes(record.path / log)) is not None:
                    (copy / packed_name(log)).write_bytes(pack(content))
            if policy and (content := _policy(record, target)) is not None:
                (copy / POLICY).write_bytes(content)
            put_in_place(copy, target)
    except OSError as error:
        raise RecordError(f"{target}: cannot be written: {error.strerror}", CANNOT_WRITE) from error
