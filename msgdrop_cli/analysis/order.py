"""In which order variants stand: as asked, else as their definition lists them, then by name."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from msgdrop_cli.definition.load import list_askable, load_definition
from msgdrop_cli.records.store import RunRecord

Group = TypeVar("Group", bound=tuple[Any, ...])


def in_order(
    runs: Mapping[tuple[Group, str, str], Sequence[RunRecord]], asked: Sequence[str]
) -> list[tuple[Group, str, str]]:
    """The keys of `runs`, (group, variant, set-up): group by group, the variants in their order."""
    members: dict[Group, list[RunRecord]] = defaultdict(list)
    for (group, _, _), records in runs.items():
        members[group] += records
    keys = []
    for group in sorted(members):
        order = asked or definition_order(members[group])
        ranks = {variant: rank for rank, variant in enumerate(order)}
        of_group = sorted(key for key in runs if key[0] == group)
        keys += sorted(of_group, key=lambda key: ranks.get(key[1], len(ranks)))
    return keys


def definition_order(records: Sequence[RunRecord]) -> tuple[str, ...]:
    """The variants of the shipped definitions that these runs name, in the definitions' order.

    A definition that more of the runs name goes first, then by name, so that the order depends on
    the records alone. What a definition of somebody's own lists is not known from its records.
    """
    trained = Counter(record.definition for record in records)
    shipped = sorted(trained.keys() & set(list_askable()), key=lambda d: (-trained[d], d))
    return tuple(dict.fromkeys(v for name in shipped for v in load_definition(name).variants))
