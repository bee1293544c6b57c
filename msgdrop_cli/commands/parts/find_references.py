"""Finds what reference policies get in the games of some runs, and plays them where it is new."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from msgdrop_cli.commands.parts import console
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.references import (
    References,
    find_references,
    game_key,
    keep_references,
    read_references,
)
from msgdrop_cli.records.store import RUN, RunRecord
from msgdrop_cli.report.write import home_of


def references_of(
    records: Sequence[RunRecord], root: Path, *, kept_in: Path | None = None
) -> dict[str, References]:
    """The reference policies of every game among finished runs, by `game_key`.

    They are looked for below `root` and in the results folder that it lies in, and kept there, or
    in `kept_in`, if that can be written to: nothing is kept in a run, or in what is published. A
    damaged file is noted and made again. A game that this program cannot play has none.
    """
    home = kept_in or home_of(root)
    found: dict[str, References] = {}
    for record in records:
        if record.status != "done" or record.setup is None:
            continue
        key = game_key(record.setup.environment)
        references = found.get(key) or _kept(root, key)
        if references is None and home != root:
            references = _kept(home, key)
        references = references or _played(record, home, key)
        if references is not None:
            found[key] = references
    return found


def _kept(root: Path, key: str) -> References | None:
    try:
        return find_references(root, key)
    except RecordError as error:  # an hour's results must not wait for what takes seconds to make
        console.note(f"{error}; it is made again")
        return None


def _played(record: RunRecord, root: Path, key: str) -> References | None:
    from msgdrop_cli.engine.play_references import play_references

    console.note(f"playing the reference policies of {record.environment}")
    try:
        table = play_references(record.spec, str(record.path / RUN))
        references = read_references(table, str(record.path / RUN))
    except (DefinitionError, RecordError) as error:  # a record of another program, or of no game
        console.note(f"{error}; figures and tables go without reference policies")
        return None
    with suppress(RecordError):  # a folder that is not ours: they are played again next time
        keep_references(root, key, table)
    return references
