"""What `unstable-test --sweep` does: play what is missing at every setting, then show it."""

import math
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from msgdrop_cli.analysis.summary import Group, summarise
from msgdrop_cli.analysis.sweeps import Swept, sweep_arms
from msgdrop_cli.commands.parts import console
from msgdrop_cli.commands.parts.find_references import references_of
from msgdrop_cli.commands.parts.play_missing import evaluated, measurable_runs
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.sweep import Sweep
from msgdrop_cli.report.sweeps import sweep_table, write_sweep
from msgdrop_cli.report.write import figures_folder


def show_sweep(
    results: Path, sweep: Sweep, *, episodes: int, workers: int, device: str, as_json: bool
) -> int:
    """Evaluate the policies of a folder at every setting, and show each variant's curve.

    Returns the exit code: that of the worst run that could not be evaluated, or 0. Raises
    DefinitionError for a folder without policies, RecordError and Stopped.
    """
    runs = measurable_runs(results, sweep.channels, episodes, listeners_only=True)
    told = f"{several(len(runs), 'trained run')} below {results}"
    console.note(f"{told}, {several(len(sweep.channels), 'setting')}")
    with ExitStack() as keep:
        records, exit_code = evaluated(
            runs, sweep.channels, episodes, device=device, workers=workers, keep=keep
        )
        measured = summarise(records, references=references_of(records, results), episodes=episodes)
    summary = replace(measured, tells_origin=True)
    folder = figures_folder(results, "unstable-test")
    shown: list[tuple[Group, list[Swept]]] = []
    say = console.note if as_json else console.result
    for group in summary.groups:
        if not (swept := sweep_arms(summary, group, sweep)):
            continue
        shown.append((group, swept))
        if not as_json:
            console.table(sweep_table(summary, group, sweep, swept), numbers_from=1)
    # The numbers may have taken minutes, so they are shown before a figure can fail.
    if as_json:
        arms = [_line(group, each, sweep) for group, swept in shown for each in swept]
        console.result_json({"sweep": sweep.text, "arms": arms})
    for group, swept in shown:
        for path in write_sweep(summary, group, sweep, swept, folder):
            if path.suffix in (".png", ".csv"):
                say(f"wrote  {path}")
    return exit_code


def _line(group: Group, swept: Swept, sweep: Sweep) -> dict[str, object]:
    """One arm for other programs; a fall that never comes is null, as one without FDC is."""
    fall = swept.fall if swept.fall is None or math.isfinite(swept.fall) else None
    return {
        **group._asdict(),
        "variant": swept.arm.variant,
        "label": swept.arm.label,
        "settings": list(sweep.values),
        "mean": [row.mean for row in swept.rows],
        "by_seed": [{str(seed): v for seed, v in row.by_seed.items()} for row in swept.rows],
        "mean_over_range": swept.area,
        "falls_below_fdc": fall,
        "falls_by_seed": {
            str(seed): value if math.isfinite(value) else None
            for seed, value in swept.falls.items()
        },
    }
