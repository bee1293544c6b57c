"""What `unstable-test --links` does: what each link is worth to each policy."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from msgdrop_cli.analysis.statistics import mean
from msgdrop_cli.commands.parts import console
from msgdrop_cli.commands.parts.options import check_device
from msgdrop_cli.commands.parts.play_missing import measurable_runs
from msgdrop_cli.commands.parts.progress import run_name
from msgdrop_cli.definition.channel import NONE_BROKEN
from msgdrop_cli.records.store import POLICY, RunRecord
from msgdrop_cli.report.table import Table

if TYPE_CHECKING:
    from msgdrop_cli.engine.worst_links import Link

_SHOWN = 3
"""Of the links that cost most, in a row of the table."""


def show_links(results: Path, *, episodes: int | None, device: str, as_json: bool) -> int:
    """Break one link after the other of every policy in a folder, and show what it costs.

    episodes: of each link; None: as many as the engine takes to find the worst ones.
    Returns the exit code, 0. Raises DefinitionError for a folder without policies, and RecordError.
    """
    from msgdrop_cli.engine.worst_links import EPISODES, links_of_run

    check_device(device)
    count = episodes or EPISODES
    runs = measurable_runs(results, [NONE_BROKEN], 1, listeners_only=True)
    found = []
    for run in [run for run in runs if (run.path / POLICY).is_file()]:
        name = run_name(run.environment, run.label, run.seed)
        console.note(f"evaluating   {name}, without each of its links")
        found.append((run, *links_of_run(run.path, count, device)))
    if as_json:
        console.result_json([{**_line(*each), "episodes": count} for each in found])
        return 0
    for scale in dict.fromkeys(_scale(run) for run, _, _ in found):
        rows = [_row(*each) for each in found if _scale(each[0]) == scale]
        console.table(
            Table(
                title=f"What each link is worth, {scale}",
                headers=("variant", "seed", "all links", "mean cost", "cost most: agents (return)"),
                rows=tuple(rows),
                caption=f"return = sum over agents and steps, mean of {count:,} greedy episodes"
                " on games of their own, the same for every link; cost = what is lost of it when"
                " this link alone is broken, both ways. Agents count from 0, and are others in"
                " every seed.",
            ),
            numbers_from=1,
        )
    return 0


def _scale(run: RunRecord) -> str:
    """What the runs of one table share."""
    return f"{run.environment}, profile {run.profile}, {run.env_steps:,} env steps a run"


def _row(run: RunRecord, whole: float, links: "Sequence[Link]") -> tuple[str, ...]:
    worst = ", ".join(
        f"{one}-{other} ({whole - returns:.1f})" for (one, other), returns in links[:_SHOWN]
    )
    cost = mean([whole - link.returns for link in links])
    return (run.label, str(run.seed), f"{whole:.1f}", f"{cost:.2f}", worst)


def _line(run: RunRecord, whole: float, links: "Sequence[Link]") -> dict[str, object]:
    costs = [{"agents": list(link.agents), "costs": whole - link.returns} for link in links]
    about = {"environment": run.environment, "variant": run.variant, "seed": run.seed}
    return {**about, "run_id": run.run_id, "return": whole, "links": costs}
