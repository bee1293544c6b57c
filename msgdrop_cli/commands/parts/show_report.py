"""Shows what records say: tables, verdicts on claims, figures; as text or as one JSON document."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from msgdrop_cli.analysis.claims import judge_claims
from msgdrop_cli.analysis.provenance import origin
from msgdrop_cli.analysis.summary import Summary, summarise
from msgdrop_cli.analysis.verdict import Verdict
from msgdrop_cli.commands.parts import console
from msgdrop_cli.commands.parts.find_references import references_of
from msgdrop_cli.commands.parts.play_missing import only
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.spec import Claim, Definition
from msgdrop_cli.records.pretraining import Pretraining
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.report.figures import draw_all
from msgdrop_cli.report.table import channels_table, claims_table, results_table
from msgdrop_cli.report.write import Folder

_TEXT_COLUMNS = 2
"""Variant and seeds; every other column holds numbers."""


def report(
    records: Sequence[RunRecord],
    root: Path,
    *,
    channels: Sequence[Channel],
    episodes: int,
    question: Definition | None = None,
    claims: Sequence[Claim] = (),
    figures: Folder | None = None,
    as_json: bool = False,
    about: Mapping[str, Any] | None = None,
) -> None:
    """Show one table per group of comparable runs, the claims' verdicts, and the figures' paths.

    With several channels a second table stands them side by side. Every number is of the first
    `episodes` of an evaluation. question: it orders the variants and says how its claims are
    judged, those of `claims`. Reference policies are looked for, and kept, in the results folder
    `root`. The numbers may have taken minutes, so they are shown before a figure can fail.
    Raises RecordError: rows that cannot be read, or figures that cannot be written (73, 74).
    """
    measured = summarise(
        records,
        order=tuple(question.variants) if question else (),
        references=references_of(records, root),
        episodes=episodes,
    )
    everything = replace(measured, tells_origin=True)
    summary = only(everything, channels)
    verdicts = judge_claims(claims, summary, question) if question else []
    if as_json:
        _report_json(everything, summary, verdicts, figures, claims, about or {})
        return
    for group in summary.groups:
        console.table(results_table(summary, group, channels[0]), numbers_from=_TEXT_COLUMNS)
        if len(channels) > 1:
            console.table(channels_table(summary, group), numbers_from=_TEXT_COLUMNS)
    for known in _encoders(records):
        left = (f"{name} {each.share_left:.0%}" for name, each in known.errors.items())
        console.result(f"\nencoder  {known.folder}: of what is seen it loses {', '.join(left)}")
    if question and verdicts:
        _show(verdicts, summary, "Claims of the paper" if question.shipped else "Claims")
    if figures:
        note_left_out(everything)
    drawn = draw_all(everything, figures, claims or None) if figures else []
    for number, path in enumerate(path for path in drawn if path.suffix == ".png"):
        console.result(("" if number or verdicts else "\n") + f"figure  {path}")


def _report_json(
    everything: Summary,
    summary: Summary,
    verdicts: Sequence[Verdict],
    figures: Folder | None,
    claims: Sequence[Claim],
    about: Mapping[str, Any],
) -> None:
    """The same as one document; it is shown even if the figures cannot be written."""
    drawn: list[Path] = []
    try:
        drawn = draw_all(everything, figures, claims or None) if figures else []
    finally:
        console.result_json(
            {
                **about,
                "results": summary.to_json(),
                "references": {key: asdict(each) for key, each in summary.references.items()},
                "claims": [_verdict_json(each, _runs_of(each, summary)) for each in verdicts],
                "figures": [str(path) for path in drawn],
            }
        )


def _encoders(records: Sequence[RunRecord]) -> list[Pretraining]:
    """What the encoders of some runs have learnt, each once."""
    found = (record.pretraining for record in records)
    return list({known.folder: known for known in found if known}.values())


def note_left_out(summary: Summary) -> None:
    """Say that figures or tables are without evaluations that are too short to be compared."""
    if summary.left_out:
        console.note(f"left out, with fewer episodes: {several(summary.left_out, 'evaluation')}")


def _show(verdicts: Sequence[Verdict], summary: Summary, title: str) -> None:
    """Claims as paragraphs: their sentences are too long for the cells of a terminal's table."""
    rows = []
    lines = claims_table(verdicts).rows
    for each, (claim, on, compared, difference, word, why) in zip(verdicts, lines, strict=True):
        about = "; ".join(filter(None, (why, on, origin(_runs_of(each, summary)))))
        rows.append((word, claim, f"{compared}: difference {difference}", about))
    console.verdicts(title, rows)


def _runs_of(verdict: Verdict, summary: Summary) -> list[RunRecord]:
    """The finished runs of both arms, those of `better` first."""
    arms = summary.arms_of(verdict.group) if verdict.group else ()
    compared = (verdict.claim.better, verdict.claim.worse)
    return [run for name in compared for arm in arms if arm.variant == name for run in arm.done]


def _verdict_json(verdict: Verdict, runs: Sequence[RunRecord]) -> dict[str, Any]:
    claim = verdict.claim
    return {
        "says": claim.says,
        "source": claim.source,
        "better": claim.better,
        "worse": claim.worse,
        "environment": claim.environment,
        "metric": claim.metric,
        "measure": claim.measure,
        **claim.channel.entry,
        "group": verdict.group._asdict() if verdict.group else None,
        "verdict": verdict.verdict,
        "reason": verdict.reason,
        "difference": verdict.difference,
        "low": verdict.interval.low if verdict.interval else None,
        "high": verdict.interval.high if verdict.interval else None,
        "seeds": verdict.seeds,
        "lost": verdict.lost,
        "runs": {run.run_id: "own" if run.is_own else "published" for run in runs},
        "evidence": verdict.evidence._asdict() if verdict.evidence else None,
        "anytime": verdict.anytime.to_json() if verdict.anytime else None,
        "prospect": verdict.prospect._asdict() if verdict.prospect else None,
    }
