"""Puts the page together: runs, verdicts, what would decide them, figures, tables."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from os.path import lexists
from pathlib import Path

from msgdrop_cli import __version__
from msgdrop_cli.analysis.provenance import Dropped, lost_runs, makers, origin, runs_of_no_claim
from msgdrop_cli.analysis.reproduction import Section, reproduce
from msgdrop_cli.analysis.summary import Group, Summary
from msgdrop_cli.commands.parts.answers import Answers, find_answers
from msgdrop_cli.commands.parts.estimate import check_folder
from msgdrop_cli.commands.parts.train_missing import Means, train_missing
from msgdrop_cli.commands.parts.ways import wanted_runs, with_ways
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.figures import all_figures
from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.readings import all_readings
from msgdrop_cli.definition.statements import read_register
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.sums import SUMS, differences
from msgdrop_cli.report.figures import draw_all, file_stem
from msgdrop_cli.report.page.content import Page, Picture, with_few_colours
from msgdrop_cli.report.table import Table, channels_table, results_table
from msgdrop_cli.report.write import Folder, home_of
from msgdrop_cli.signals import scratch_folder


def train(root: Path, means: Means) -> int:
    """Train what the open claims of the records in a folder lack; returns the exit code.

    Raises DefinitionError, RecordError and Stopped as `train_missing`.
    """
    from msgdrop_cli.engine.offers import catalogue

    home = home_of(root)  # nothing is trained inside of what is published
    check_folder(home, 0)
    answers, sections = _told(root)
    finished = [record for record in answers.records if record.status == "done"]
    return train_missing(wanted_runs(sections, answers, catalogue()), finished, home, means)


def paper_page(root: Path, *, workers: int, device: str) -> Page:
    """The page of the records in or below a folder. Loads torch and matplotlib.

    workers, device: what is missing would be trained with, which decides how long it takes.

    Raises RecordError for a folder that cannot be read.
    """
    from msgdrop_cli.engine.facts import commit
    from msgdrop_cli.engine.offers import catalogue

    answers, judged = _told(root)
    sections = with_ways(judged, answers, catalogue(), workers=workers, device=device)
    summaries = {each.definition.name: each.summary for each in answers.answers}
    pictures = _pictures(sections, summaries)
    return Page(
        sections=sections,
        pictures=pictures,
        tables={
            section.key: _tables(_part(summaries[section.question], section))
            for section in sections
        },
        register=read_register(),
        readings={name: each.says for name, each in all_readings().items()},
        makers=makers(answers.records),
        dropped=_dropped(answers),
        altered=_altered(answers),
        folder=str(root),
        origin=origin([record for record in answers.records if record.status == "done"]),
        version=__version__,
        commit=commit(),
    )


def _altered(answers: Answers) -> tuple[str, ...]:
    """Of the published folders that the runs lie in those that their own list denies."""
    runs = [record.path for copies in answers.copies.values() for record in copies]
    runs += [each.path for each in answers.unreadable]
    places = {folder for run in runs for folder in run.parents}
    found = []
    for folder in sorted(place for place in places if lexists(place / SUMS)):
        try:
            count = len([*differences(folder)])
        except RecordError as error:
            found.append(f"{error}: msgdrop verify {folder}")
            continue
        if count:
            files = several(count, "file")
            differ = "differs" if count == 1 else "differ"
            found.append(f"{files} in {folder} {differ} from its {SUMS}: msgdrop verify {folder}")
    return tuple(found)


def _told(root: Path) -> tuple[Answers, tuple[Section, ...]]:
    """The runs of a folder, and what they say of every claim."""
    from msgdrop_cli.engine.offers import catalogue

    definitions = [load_definition(name) for name in list_definitions()]
    answers = find_answers(root, definitions, catalogue())
    return answers, reproduce(answers.answers, all_figures())


def _part(summary: Summary, section: Section) -> Summary:
    """Of a question's arms those in the section's games."""
    arms = [arm for arm in summary.arms if arm.group.environment in section.environments]
    return replace(summary, arms=tuple(arms))


def _tables(summary: Summary) -> tuple[Table, ...]:
    found = []
    for group in summary.groups:
        found.append(results_table(summary, group))
        if len({row.channel for arm in summary.arms_of(group) for row in arm.rows}) > 1:
            found.append(channels_table(summary, group))
    return tuple(found)


def _pictures(
    sections: Sequence[Section], summaries: dict[str, Summary]
) -> dict[str, tuple[Picture, ...]]:
    """The figures of each section's question that show what its claims are about."""
    found: dict[str, tuple[Picture, ...]] = {}
    for question, summary in summaries.items():
        mine = [section for section in sections if section.question == question]
        if not summary.arms or not mine:
            continue
        shown = partial(_shown, sections=mine, groups=summary.groups)
        with scratch_folder() as scratch:
            drawn = draw_all(summary, Folder(scratch), suffixes=("png",), wanted=shown)
            pictures = [(path.stem, with_few_colours(path.read_bytes())) for path in drawn]
        for section in mine:
            found[section.key] = tuple(
                Picture(name, _alt(name, section), png)
                for name, png in pictures
                if _belongs(name, section, summary.groups)
            )
    return found


def _shown(name: str, sections: Sequence[Section], groups: Sequence[Group]) -> bool:
    """Whether a figure belongs to one of the sections; the others need not be drawn."""
    return any(_belongs(name, section, groups) for section in sections)


def _belongs(name: str, section: Section, groups: Sequence[Group]) -> bool:
    """Whether a figure shows what a section is about: its games, its measure, its channels."""
    mine = [group for group in groups if group.environment in section.environments]
    kinds = [name.removeprefix(f"{file_stem(group)}-") for group in mine]
    kind = next((kind for kind in kinds if kind != name), None)
    if kind is None:
        return False
    if "learning" in kind:
        return "learning" in section.measures
    through = any(line.channel for line in section.lines)
    beside_the_point = (
        kind == "dropout-rate" if through else kind in ("broken-links", "channels", "matrix")
    )
    return "evaluation" in section.measures and not beside_the_point


def _alt(name: str, section: Section) -> str:
    return f"{section.title}: {name}"


def _dropped(answers: Answers) -> tuple[Dropped, ...]:
    unreadable = [
        Dropped(what="unreadable", name=str(each.path), runs=1, reason=each.reason)
        for each in answers.unreadable
    ]
    return (*lost_runs(answers.records), *unreadable, *runs_of_no_claim(answers.others))
