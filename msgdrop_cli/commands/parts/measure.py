"""What `eval` and `unstable-test` do: play what is missing, then report."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from msgdrop_cli.commands.parts import console
from msgdrop_cli.commands.parts.play_missing import evaluated, measurable_runs
from msgdrop_cli.commands.parts.show_report import report
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.spec import Claim, Definition
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.report.write import figures_folder


def measure(
    results: Path,
    *,
    channels: Sequence[Channel],
    episodes: int,
    workers: int,
    device: str,
    as_json: bool,
    question: Definition | None = None,
) -> int:
    """Report every trained policy in a folder through each of these channels.

    With a question about broken links, runs whose agents hear nobody are left out, its claims are
    judged where both variants are there, and figures are drawn.
    Returns the exit code: that of the worst run that could not be evaluated, or 0.
    Raises DefinitionError for a folder without policies, RecordError and Stopped.
    """
    runs = measurable_runs(results, channels, episodes, listeners_only=question is not None)
    console.note(f"{several(len(runs), 'trained run')} below {results}")
    with ExitStack() as keep:
        records, exit_code = evaluated(
            runs, channels, episodes, device=device, workers=workers, keep=keep
        )
        if records or as_json:
            report(
                records,
                results,
                channels=channels,
                episodes=episodes,
                question=question,
                claims=_judgeable(question, records) if question else (),
                figures=figures_folder(results, "unstable-test") if question else None,
                as_json=as_json,
            )
    return exit_code


def _judgeable(question: Definition, records: Sequence[RunRecord]) -> list[Claim]:
    """The claims whose two variants were both trained, on their environment."""
    arms = {(record.environment, record.variant) for record in records}
    return [
        claim
        for claim in question.claims
        if {(claim.environment, claim.better), (claim.environment, claim.worse)} <= arms
    ]
