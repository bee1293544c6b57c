"""`msgdrop verify`: every published number, verdict and figure once more, from the records."""

from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import typer

from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.sums import Difference
from msgdrop_cli.signals import scratch_folder

DIFFERS = 65
"""The exit code where something is not what its records give, EX_DATAERR of sysexits.h."""
_SHOWN = 3
"""Differences of one place that are told; the others are counted, and all are in the JSON."""

app = typer.Typer()


@app.command(
    epilog=options.examples("verify", "verify results/published/broken-links-two-million --json")
)
def verify(results: options.Folder = Path("results"), json: options.Json = False) -> int:
    """Check published records, tables, verdicts and figures.

    Every file is compared with SHA256SUMS, and what is made of the runs is made again from their
    episodes and logs. Your own runs are checked against their records, and against the digests
    that lie with each since it was done. Trains and plays nothing, and changes nothing.
    """
    from msgdrop_cli.commands.parts.verified import Verified, verified

    found: list[Verified] = []
    with scratch_folder() as scratch:
        for each in verified(results, scratch):
            found.append(each)
            if not json:
                _show(each.place, each.looked_at, each.differences, each.not_compared)
    if json:
        console.result_json([_entry(each) for each in found])
    if wrong := [*chain.from_iterable(each.differences for each in found)]:
        message = f"{several(len(wrong), 'difference')}; the first: {wrong[0]}"
        raise RecordError(message, DIFFERS)
    return 0


def _show(
    place: Path, looked_at: str, wrong: Sequence[Difference], not_compared: Sequence[str]
) -> None:
    word = "differs" if wrong else "same"
    console.result(f"{word:<8} {one_line(str(place))}  ({looked_at})")
    lines = [str(each).removeprefix(f"{place}/") for each in wrong[:_SHOWN]]
    if len(wrong) > _SHOWN:
        lines.append(f"and {len(wrong) - _SHOWN:,} more")
    lines += [f"not compared: {words}" for words in not_compared]
    for line in lines:
        console.result(f"{'':<8} {one_line(line)}")


def _entry(each: Any) -> dict[str, Any]:
    return {
        "place": str(each.place),
        "looked_at": each.looked_at,
        "differences": [
            {**difference._asdict(), "file": str(difference.file)}
            for difference in each.differences
        ],
        "not_compared": list(each.not_compared),
    }
