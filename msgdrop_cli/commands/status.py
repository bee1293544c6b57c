"""`msgdrop status`: which runs there are and how far they have come; loads nothing heavy."""

import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import typer

from msgdrop_cli.analysis.labels import with_overrides
from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.commands.parts.listing import runs_in
from msgdrop_cli.commands.parts.words import duration, several
from msgdrop_cli.records.store import PROGRESS, RunRecord

app = typer.Typer()

_HEADERS = ("environment", "variant", "profile", "status", "seed", "env steps", "done", "left")
_PUBLISHED_HEADERS = ("question", "environment", "variant", "profile", "seeds", "env steps")
_TEXT_COLUMNS = 4
"""The columns after them hold numbers."""
_LABEL = 24
"""Letters of a label in the table, so that the status word has room beside it on 80 columns."""
_SILENT_S = 30.0
"""A run at work writes about once a second; who is silent for so long may have been killed."""


@app.command(epilog=options.examples("status", "status results/runs/pursuit-n6 --json"))
def status(results: options.Folder = Path("results"), json: options.Json = False) -> int:
    """List the runs and how far they have come.

    What is still to be trained is `planned`. Published runs, if any, come after your own.
    """
    from msgdrop_cli.commands.parts.progress import progress

    lines = [_line(record, progress(record.path)) for record in runs_in(results)]
    lines.sort(key=lambda line: not line["own"])  # stays sorted by path among its own kind
    if json:
        console.result_json(lines)
        return 0
    own = [line for line in lines if line["own"]]
    if own:
        _show("run", _HEADERS, own, [_cells(line) for line in own])
    if others := lines[len(own) :]:
        _show("published run", _PUBLISHED_HEADERS, others, _published(others))
    for line in lines:
        if line["reason"]:
            console.result(f"{line['status']}: {line['path']}: {line['reason']}")
    return 0


def _show(
    kind: str,
    headers: tuple[str, ...],
    lines: Sequence[dict[str, Any]],
    rows: Sequence[tuple[str, ...]],
) -> None:
    from msgdrop_cli.report.table import Table

    words = [line["status"] for line in lines]
    counts = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
    title = f"{several(len(lines), kind)}: {counts}"
    table = Table(title=title, headers=headers, rows=tuple(rows), caption="")
    console.table(table, numbers_from=_TEXT_COLUMNS)


def _published(lines: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """A row for each variant: nobody waits for these, and they would push the own ones away."""
    keys = ("definition", "environment", "label", "profile")
    seeds = Counter((*(line[key] for key in keys), f"{line['env_steps']:,}") for line in lines)
    return [(*row[:_TEXT_COLUMNS], str(count), row[-1]) for row, count in seeds.items()]


def _line(record: RunRecord, now: dict[str, Any]) -> dict[str, Any]:
    setup = record.setup
    running = record.status == "running"
    return {
        "environment": record.environment,
        "variant": record.variant,
        "label": with_overrides(record.label, record.variant, record.overrides),
        "seed": record.seed,
        "definition": record.definition,
        "profile": record.profile,
        "run_id": record.run_id,
        "status": record.status,
        "reason": record.reason,
        "env_steps": int(now["env_steps"]) if running and now else record.env_steps,
        "train_env_steps": setup.train_env_steps if setup else None,
        "env_steps_per_s": now.get("env_steps_per_s") if running else None,
        "eta_s": now.get("eta_s") if running else None,
        "silent_s": _silence(record) if running else None,
        "own": record.is_own,
        "path": str(record.path),
    }


def _silence(record: RunRecord) -> float | None:
    """Seconds since a running run wrote its progress, by the clock of the file system."""
    with suppress(OSError):
        return max(0.0, round(time.time() - (record.path / PROGRESS).stat().st_mtime, 1))
    return None


def _cells(line: dict[str, Any]) -> tuple[str, ...]:
    total, left = line["train_env_steps"], line["eta_s"]
    word = str(line["status"])
    if word == "running" and (line["silent_s"] is None or line["silent_s"] > _SILENT_S):
        word = "running?" if line["silent_s"] is None else f"silent {duration(line['silent_s'])}"
        left = None
    return (
        line["environment"],
        line["label"] if len(line["label"]) <= _LABEL else f"{line['label'][: _LABEL - 1]}…",
        line["profile"],
        word,
        str(line["seed"]),
        f"{line['env_steps']:,}",
        f"{line['env_steps'] / total:.0%}" if total else "",
        duration(left) if left is not None else "",
    )
