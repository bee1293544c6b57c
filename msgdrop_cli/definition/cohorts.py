"""Which runs train stacked in one process: those that share every tensor shape and schedule."""

import json
from collections.abc import Iterable

from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.definition.spec import PlannedRun


def group(runs: Iterable[PlannedRun], size: int) -> list[tuple[PlannedRun, ...]]:
    """Cohorts of at most `size` runs that differ in their seed and dropout rate only.

    Runs with one id are one run: the first stands for all. A group that is too large is split as
    evenly as possible. The order of `runs` is kept. Raises ValueError for `size` below 1.
    """
    if size < 1:
        raise ValueError(f"a cohort holds at least 1 run, not {size}")
    distinct: dict[str, PlannedRun] = {}
    for run in runs:
        distinct.setdefault(run.run_id, run)
    alike: dict[str, list[PlannedRun]] = {}
    for run in distinct.values():
        alike.setdefault(_key(run), []).append(run)
    return [chunk for members in alike.values() for chunk in _split(members, size)]


def _key(run: PlannedRun) -> str:
    table = spec_to_dict(run.spec)
    del table["seed"]
    table["algorithm"].pop("rate", None)
    return json.dumps(table, sort_keys=True)


def _split(members: list[PlannedRun], size: int) -> list[tuple[PlannedRun, ...]]:
    count = -(-len(members) // size)
    ends = [len(members) * number // count for number in range(count + 1)]
    return [tuple(members[ends[i] : ends[i + 1]]) for i in range(count)]
