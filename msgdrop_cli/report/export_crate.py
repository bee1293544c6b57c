"""A research object (RO-Crate 1.1): tables, and a manifest of every run, the dropped ones included.

Each run is an action of the program, with its status and, where it broke down, the reason; the
manifest says the same as a table.
"""

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

from msgdrop_cli import __version__
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.report.tidy import Columns

METADATA = "ro-crate-metadata.json"
_CONTEXT = "https://w3id.org/ro/crate/1.1/context"
_STATUS = {"done": "Completed", "failed": "Failed", "diverged": "Failed", "running": "Active"}
"""What schema.org calls an action that is so; anything else is yet potential."""
_DESCRIPTIONS = {
    "results.csv": "A row for each run and channel that it was evaluated through",
    "curves.csv": "A row for each run and window of its training",
    "runs.csv": "Manifest: every run, whether it counts, and if not why",
}


def manifest(records: Sequence[RunRecord]) -> Columns:
    """A row for each run: what it is, where it lies, and why it is dropped, if it is."""
    rows = [(*_about(record), record.status == "done", _dropped(record)) for record in records]
    names = ("run_id", "question", "environment", "variant", "profile", "seed", "status", "path")
    return {
        name: [row[place] for row in rows]
        for place, name in enumerate((*names, "counts", "dropped_because"))
    }


def _about(record: RunRecord) -> Sequence[Any]:
    return (
        *(record.run_id, record.definition, record.environment, record.variant, record.profile),
        *(record.seed, record.status, str(record.path)),
    )


def _dropped(record: RunRecord) -> str | None:
    """Why a run is in no mean; None if it is in them."""
    if record.status == "done":
        return None
    unfinished = f"after {record.env_steps:,} env steps"
    return f"{record.status}: {record.reason or unfinished}"


def crate_metadata(records: Sequence[RunRecord], files: Mapping[str, bytes]) -> dict[str, Any]:
    """The crate's JSON-LD; files: what lies beside it, by name."""
    runs = {f"#{_place(record)}": record for record in records}
    dropped = [record for record in records if record.status != "done"]
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": f"Runs of msgdrop: {', '.join(sorted({run.definition for run in records}))}",
        "description": f"{len(records)} runs, of which {len(dropped)} are dropped (runs.csv has "
        "why). Settings, logs and raw episodes lie in the runs' own folders.",
        "datePublished": max((str(run.run.get("created") or "") for run in records), default=""),
        "hasPart": [{"@id": name} for name in files],
        "mentions": [{"@id": name} for name in runs],
    }
    descriptor = {
        "@id": METADATA,
        "@type": "CreativeWork",
        "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        "about": {"@id": "./"},
    }
    program = {
        "@id": "#msgdrop",
        "@type": "SoftwareApplication",
        "name": "msgdrop",
        "softwareVersion": __version__,
    }
    graph = [descriptor, root, program, *(_file(name, files[name]) for name in files)]
    return {"@context": _CONTEXT, "@graph": [*graph, *(_run(i, run) for i, run in runs.items())]}


def _place(record: RunRecord) -> str:
    return f"{record.profile}/{record.environment}/{record.variant}-s{record.seed}-{record.run_id}"


def _file(name: str, content: bytes) -> dict[str, Any]:
    return {
        "@id": name,
        "@type": "File",
        "name": name,
        "description": _DESCRIPTIONS[name],
        "encodingFormat": "text/csv",
        "contentSize": str(len(content)),
        "sha256": hashlib.sha256(content).hexdigest(),
    }


def _run(name: str, record: RunRecord) -> dict[str, Any]:
    status = _STATUS.get(record.status, "Potential")
    action = {
        "@id": name,
        "@type": "CreateAction",
        "name": f"{record.label}, {record.environment}, seed {record.seed}",
        "identifier": record.run_id,
        "instrument": {"@id": "#msgdrop"},
        "actionStatus": {"@id": f"http://schema.org/{status}ActionStatus"},
        "result": {"@id": "results.csv"},
    }
    why = _dropped(record)
    return action if why is None else {**action, "error": why}
