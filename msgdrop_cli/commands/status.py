"""`msgdrop status`: which runs there are and how far they have come; loads nothing heavy."""

import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from msgdrop_cli.analysis.labels import with_overrides
from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.commands.parts.listing import runs_in
from msgdrop_cli.commands.parts.words import counted, duration, several
from msgdrop_cli.records.files import LOCK
from msgdrop_cli.records.holders import Held, is_held, locked_files
from msgdrop_cli.records.store import PROGRESS, RunRecord

app = typer.Typer()

_HEADERS = ("environment", "variant", "profile", "status", "seed", "env steps", "done", "left")
_MANY_HEADERS = ("environment", "variant", "profile", "status", "runs", "env steps", "done", "left")
_PUBLISHED_HEADERS = ("question", "environment", "variant", "profile", "seeds", "env steps")
_TEXT_COLUMNS = 4
"""The columns after them hold numbers."""
_HEADINGS = 2
"""Of them so many may stand above their rows, in a narrow terminal."""
_LABEL = 24
"""Letters of a label in the table, so that the status word has room beside it on 80 columns."""
_COPIES = "A run that stands in several studies is counted in each of them."
_MOST_ROWS = 100
"""Runs with a row each; of more a row says how many of an arm are how far."""
_NAMED = 3
"""Runs that are named where there may be many."""
_SILENT_S = 30.0
"""A run at work writes about once a second; who is silent for so long may have been killed."""


_Why = Annotated[
    bool, typer.Option("--why", help="Only what is missing or stale, why, and what to type.")
]


@app.command(
    epilog=options.examples("status", "status --why", "status results/runs/pursuit-n6 --json")
)
def status(
    results: options.Folder = Path("results"), why: _Why = False, json: options.Json = False
) -> int:
    """List the runs and how far they have come.

    What is still to be trained is `planned`. Published runs, if any, come after your own.
    """
    from msgdrop_cli.commands.parts.progress import progress

    records = runs_in(results)
    if why:
        return _show_why(records, as_json=json)
    held = locked_files()
    lines = [
        _line(record, progress(record.path) if record.status == "running" else {}, held)
        for record in records
    ]
    lines.sort(key=lambda line: not line["own"])  # stays sorted by path among its own kind
    if json:
        console.result_json(lines)
        return 0
    own = [line for line in lines if line["own"]]
    if len(own) > _MOST_ROWS:
        _show("run", _MANY_HEADERS, own, _many(own))
    elif own:
        _show("run", _HEADERS, own, [_cells(line) for line in own])
    if others := lines[len(own) :]:
        _show("published run", _PUBLISHED_HEADERS, others, _published(others))
    for line in lines:
        if line["reason"]:
            console.result(f"{line['status']}: {line['path']}: {line['reason']}")
    return 0


def _show_why(records: Sequence[RunRecord], *, as_json: bool) -> int:
    from msgdrop_cli.commands.parts.why import reasons, times
    from msgdrop_cli.engine.offers import catalogue

    known = catalogue()
    found = reasons(records, known)
    taking = times(found, records, known)
    if as_json:
        console.result_json(
            [
                {
                    "status": why.word,
                    "reason": why.reason,
                    "command": why.command or None,
                    "lacks": why.lacks or None,
                    "time": takes or None,
                    "paths": [str(record.path) for record in why.records],
                }
                for why, takes in zip(found, taking, strict=True)
            ]
        )
        return 0
    for why, takes in zip(found, taking, strict=True):
        first = why.records[0]
        heading = f"{several(len(why.records), 'run')} of {first.definition}, {first.profile}"
        rows = {why.word: heading, "why": why.reason, "runs": _shortly(why.records)}
        rows |= {"type": why.command, "put in": why.lacks, "time": takes}
        console.facts({name: said for name, said in rows.items() if said}, is_result=True)
        console.result("")
    told = {record.path for why in found for record in why.records}
    others = counted([record.run_id for record in records if record.path not in told])
    beside = " beside that" if found else ""
    console.prose(f"{others}{beside}, own and published: finished and up to date, or at work")
    return 0


def _shortly(records: Sequence[RunRecord]) -> str:
    """`dcc-s1-560356a7, dcc-s2-22b8d43a and 10 more`."""
    names = [record.path.name for record in records]
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")


def _show(
    kind: str,
    headers: tuple[str, ...],
    lines: Sequence[dict[str, Any]],
    rows: Sequence[tuple[str, ...]],
) -> None:
    from msgdrop_cli.report.table import Table

    words = [line["status"] for line in lines]
    counts = ", ".join(f"{words.count(word):,} {word}" for word in dict.fromkeys(words))
    runs = counted([line["run_id"] for line in lines], kind)
    caption = _COPIES if "distinct" in runs else ""
    table = Table(title=f"{runs}: {counts}", headers=headers, rows=tuple(rows), caption=caption)
    console.table(table, numbers_from=_TEXT_COLUMNS, headings=_HEADINGS)


def _many(lines: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """A row for each arm and status word, with the env steps of all its runs."""
    arms: dict[tuple[str, ...], list[dict[str, Any]]] = {}
    for line in lines:
        arms.setdefault(_cells(line)[:_TEXT_COLUMNS], []).append(line)
    return [(*words, *_together(alike)) for words, alike in arms.items()]


def _together(lines: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """How many, their env steps, their share of all that they will have, and the longest wait."""
    steps = sum(line["env_steps"] for line in lines)
    total = sum(line["train_env_steps"] or 0 for line in lines)
    left = [line["eta_s"] for line in lines if line["eta_s"] is not None]
    share = f"{steps / total:.0%}" if total else ""
    return f"{len(lines):,}", f"{steps:,}", share, duration(max(left)) if left else ""


def _published(lines: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """A row for each variant: nobody waits for these, and they would push the own ones away."""
    keys = ("definition", "environment", "label", "profile")
    seeds = Counter((*(line[key] for key in keys), f"{line['env_steps']:,}") for line in lines)
    return [(*row[:_TEXT_COLUMNS], str(count), row[-1]) for row, count in seeds.items()]


def _line(record: RunRecord, now: dict[str, Any], held: Held) -> dict[str, Any]:
    setup = record.setup
    running = record.status == "running"
    silence = _silence(record) if running else None
    # On another machine of a shared folder, which is in no list here, somebody writes progress.
    alive = is_held(record.path / LOCK, held) or (silence or _SILENT_S) < _SILENT_S
    return {
        "environment": record.environment,
        "variant": record.variant,
        "label": with_overrides(record.label, record.variant, record.overrides),
        "seed": record.seed,
        "definition": record.definition,
        "profile": record.profile,
        "run_id": record.run_id,
        "status": "killed" if running and not alive else record.status,
        "reason": record.reason,
        "env_steps": int(now["env_steps"]) if running and now else record.env_steps,
        "train_env_steps": setup.train_env_steps if setup else None,
        "env_steps_per_s": now.get("env_steps_per_s") if running else None,
        "eta_s": now.get("eta_s") if running else None,
        "silent_s": silence,
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
    if word == "killed":
        left = None
    elif word == "running" and (line["silent_s"] or 0.0) > _SILENT_S:  # a process that is stopped
        word, left = f"silent {duration(line['silent_s'])}", None
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
