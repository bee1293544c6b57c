"""Records in the formats of others: tables, what marl-eval and rliable take, a research object."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from msgdrop_cli.analysis.summary import Summary, once_each
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.report.cells import csv_bytes
from msgdrop_cli.report.export_crate import METADATA, crate_metadata, manifest
from msgdrop_cli.report.export_marl_eval import marl_eval_data
from msgdrop_cli.report.export_rliable import rliable_data
from msgdrop_cli.report.parquet import parquet_bytes
from msgdrop_cli.report.tidy import Columns, curves_table, results_table

Files = dict[str, bytes]


def export_files(name: str, records: Sequence[RunRecord], summary: Summary) -> Files:
    """The files of one of FORMATS, whole, by their names; nothing is written yet.

    summary: of these records. Raises RecordError for unreadable rows, DefinitionError where a
    library is missing.
    """
    return FORMATS[name](records, summary)


def _csv(records: Sequence[RunRecord], _: Summary) -> Files:
    return {f"{name}.csv": _csv_table(table) for name, table in _tables(records).items()}


def _parquet(records: Sequence[RunRecord], _: Summary) -> Files:
    return {f"{name}.parquet": parquet_bytes(table) for name, table in _tables(records).items()}


def _marl_eval(_: Sequence[RunRecord], summary: Summary) -> Files:
    return {f"{name}.json": _json(table) for name, table in marl_eval_data(summary).items()}


def _rliable(_: Sequence[RunRecord], summary: Summary) -> Files:
    return {"scores.json": _json(rliable_data(summary))}


def _ro_crate(records: Sequence[RunRecord], summary: Summary) -> Files:
    runs = once_each(records)
    files = {**_csv(records, summary), "runs.csv": _csv_table(manifest(runs))}
    return {METADATA: _json(crate_metadata(runs, files)), **files}


FORMATS: Mapping[str, Callable[[Sequence[RunRecord], Summary], Files]] = {
    "csv": _csv,
    "parquet": _parquet,
    "marl-eval": _marl_eval,
    "rliable": _rliable,
    "ro-crate": _ro_crate,
}


def _tables(records: Sequence[RunRecord]) -> Mapping[str, Columns]:
    return {"results": results_table(records), "curves": curves_table(records)}


def _csv_table(columns: Columns) -> bytes:
    return csv_bytes(list(columns), zip(*columns.values(), strict=True))


def _json(value: Any) -> bytes:
    return (json.dumps(value, indent=1, allow_nan=False) + "\n").encode()
