"""A study: the runs that answer a question, the page of their tables, and their figures.

What is published is made here, and made here again when it is verified.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from msgdrop_cli.analysis.claims import judge_claims
from msgdrop_cli.analysis.summary import Summary, summarise
from msgdrop_cli.analysis.verdict import Verdict
from msgdrop_cli.definition.judged import judged_at
from msgdrop_cli.definition.spec import Claim, Definition
from msgdrop_cli.records.copies import copy_run, is_copied, with_policy
from msgdrop_cli.records.references import References
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.records.temporary import TEMPORARY
from msgdrop_cli.report.figures import draw_all
from msgdrop_cli.report.table import (
    Table,
    channels_table,
    claims_table,
    results_table,
    to_markdown,
)
from msgdrop_cli.report.write import FIGURES, TABLES, Folder, write_atomic
from msgdrop_cli.signals import scratch_folder


class Study(NamedTuple):
    """What the runs of one question and profile say."""

    summary: Summary
    claims: Sequence[Claim]
    """Those of its question that its profile can judge."""
    page: str
    """Every table and verdict, as Markdown."""


class Written(NamedTuple):
    """The files that a study is shown by."""

    page: Path
    figures: list[Path]


def study_of(
    records: Sequence[RunRecord],
    definition: Definition,
    profile: str,
    references: Mapping[str, References],
    elsewhere: Sequence[RunRecord] = (),
) -> Study:
    """Measure the runs, and judge the claims of their question that this profile can judge.

    profile: as records call it. references: by `game_key`. elsewhere: further runs, which lie in
    other studies; the page says so. Raises RecordError for unreadable rows, DefinitionError if the
    question has no such profile.
    """
    claims = judged_at(definition, profile)
    every = [*records, *elsewhere]
    summary = summarise(every, order=tuple(definition.variants), references=references)
    page = tables(summary, judge_claims(claims, summary, definition))
    if elsewhere:
        page += "\n" + to_markdown(_elsewhere(elsewhere, len(every)))
    return Study(summary, claims, page)


def write_study(study: Study, folder: Folder) -> Written:
    """Write the page and draw the figures; RecordError if the folder cannot be written (73, 74)."""
    page = write_atomic(folder, TABLES, study.page.encode())
    # What is committed stays small: `plot` makes the same figures for print again, in seconds.
    suffixes = ("png", "csv")
    return Written(page, draw_all(study.summary, folder.at(FIGURES), study.claims, suffixes))


def publish(
    records: Sequence[RunRecord], folder: Folder, elsewhere: Sequence[RunRecord] = ()
) -> list[Path]:
    """Copy finished runs below a folder: their numbers, packed, and each lowest seed's policy.

    A run that lies in the folder stays as it is, and a copy that says the same; any other one is
    replaced as a whole. elsewhere: runs of the same study that lie in another one. Returns the
    paths in the folder. Raises RecordError, damaged (2) or not writable (73, 74), with nothing
    half-copied.
    """
    policies = with_policy([*records, *elsewhere])
    for game in {record.environment for record in records}:
        with scratch_folder(folder.at(game).made(), TEMPORARY):
            pass  # what a killed process has left there is gone, and will not be listed
    copies = []
    for record in records:
        target = folder.at(record.environment).made() / record.path.name
        policy = record.run_id in policies
        if record.path != target and not is_copied(record, target, policy=policy):
            copy_run(record, target, policy=policy)
        copies.append(target)
    return copies


def tables(summary: Summary, verdicts: Sequence[Verdict]) -> str:
    """Every table of a summary as one Markdown page."""
    pages = []
    for group in summary.groups:
        pages.append(results_table(summary, group))
        if len({row.channel for arm in summary.arms_of(group) for row in arm.rows}) > 1:
            pages.append(channels_table(summary, group))
    if verdicts:
        pages.append(claims_table(verdicts))
    return "\n".join(to_markdown(page) for page in pages)


def _elsewhere(records: Sequence[RunRecord], total: int) -> Table:
    """Where the runs lie that are not here."""
    studies = Counter((each.label, each.environment, each.path.parts[-3]) for each in records)
    counted = sorted(studies.items())
    return Table(
        title="Runs that lie in other studies",
        headers=("variant", "game", "runs", "study"),
        rows=tuple((label, game, str(runs), study) for (label, game, study), runs in counted),
        caption=f"{len(records)} of the {total} runs are published with a study beside this one;"
        " elsewhere.json names each of them.",
    )
