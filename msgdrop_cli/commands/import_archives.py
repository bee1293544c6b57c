"""`msgdrop import`: archives of runs that another machine trained become run folders here."""

from collections.abc import Sequence
from itertools import chain
from json import dumps
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.commands.parts.sound import (
    check_episodes,
    check_policy,
    check_record,
    check_windows,
)
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.catalogue import Catalogue
from msgdrop_cli.definition.run_id import spec_from_dict
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.archive import install, unpack
from msgdrop_cli.records.files import CANNOT_CREATE, read_bytes
from msgdrop_cli.records.ours import refuse_links
from msgdrop_cli.records.packed import log_bytes
from msgdrop_cli.records.planned import remove_planned
from msgdrop_cli.records.store import METRICS, POLICY, RUNS, RunRecord, find_run
from msgdrop_cli.signals import scratch_folder

app = typer.Typer()


class _Found(NamedTuple):
    """A run in an archive, and where it is to stand."""

    record: RunRecord
    path: Path
    is_there: bool


@app.command(
    "import",
    epilog=options.examples("import campaign/*.zip", "import a.zip b.zip --results other-results"),
)
def import_archives(
    archives: Annotated[
        list[Path],
        typer.Argument(
            metavar="ARCHIVE...",
            help="What benchmarks/campaign.py wrote.",
            parser=options.path,
        ),
    ],
    results: options.Results = Path("results"),
    json: options.Json = False,
) -> int:
    """Turn archives of trained runs into runs here.

    Everything is checked before anything is written. A run that is there already is left alone.
    """
    options.check_place(results, "--results")
    from msgdrop_cli.engine.offers import catalogue

    with scratch_folder() as scratch:
        records = []
        for number, archive in enumerate(archives):
            folder = scratch / str(number)
            folder.mkdir()
            for record in unpack(archive, folder):
                _check(record, archive, catalogue())
                records.append(record)
        found = _places(records, results)
        found = [run if run.is_there else _installed(run) for run in found]
    _show(found, as_json=json)
    return 0


def _check(record: RunRecord, archive: Path, known: Catalogue) -> None:
    """Refuse (RecordError) what is not a finished run with all that belongs to it."""
    place = f"{record.environment}/{record.path.name}"
    named = f"{record.variant}-s{record.seed}-{record.run_id}"
    try:
        spec = spec_from_dict(record.spec, known)
        check_record(record, spec)
        if record.path.name != named:
            raise RecordError("it stands in another run's place")
        check_windows(record)
        check_episodes(record)
        check_policy(record, spec)
    except (DefinitionError, RecordError) as error:
        reason = str(error).replace(f"{record.path}/", "")
        raise RecordError(f"{archive}: {place}: {reason}") from error


def _places(records: Sequence[RunRecord], results: Path) -> list[_Found]:
    """Where each run goes; RecordError (73) where another one stands, here or in the archives."""
    found: dict[str, _Found] = {}
    for record in records:
        path = results / RUNS / record.environment / record.path.name
        if record.run_id in found:
            other: RunRecord | None = found[record.run_id].record
        else:
            other = find_run(results / RUNS, record.run_id)
            if other is not None:
                path = other.path
                other = None if other.status == "planned" else other
            refuse_links(results, path)
            found[record.run_id] = _Found(record, path, other is not None)
        if other is not None and not _is_same(record, other):
            raise RecordError(
                f"{path}: stands there with other content; move this folder away to import the run",
                CANNOT_CREATE,
            )
    return list(found.values())


def _installed(run: _Found) -> _Found:
    """The run, copied to its place; if another import was faster, it is there already."""
    try:
        remove_planned(run.path, run.record.run_id)
        install(run.record, run.path)
    except RecordError:
        other = find_run(run.path, run.record.run_id)
        if other is None or not _is_same(run.record, other):
            raise
        return run._replace(is_there=True)
    return run


def _is_same(record: RunRecord, other: RunRecord) -> bool:
    """Whether `other` is this run; it may have been evaluated further."""
    policy = other.path / POLICY
    evaluated = set(map(dumps, chain(*other.episodes().values())))
    return (
        record.run == other.run
        and log_bytes(record.path / METRICS) == log_bytes(other.path / METRICS)
        and policy.is_file()
        and read_bytes(record.path / POLICY) == read_bytes(policy)
        and evaluated.issuperset(map(dumps, chain(*record.episodes().values())))
    )


def _show(found: Sequence[_Found], *, as_json: bool) -> None:
    if as_json:
        console.result_json(
            [
                {
                    "run_id": run.record.run_id,
                    "environment": run.record.environment,
                    "variant": run.record.variant,
                    "seed": run.record.seed,
                    "path": str(run.path),
                    "imported": not run.is_there,
                }
                for run in found
            ]
        )
        return
    for run in found:
        if run.is_there:
            console.note(f"{run.path}: is there already")
        else:
            console.result(str(run.path))
    new = sum(not run.is_there for run in found)
    console.note(f"{several(new, 'run')} imported, {len(found) - new:,} already there")
