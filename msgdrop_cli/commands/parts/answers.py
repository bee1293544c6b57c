"""Finds the runs that answer the questions that are shipped, whoever trained them first.

A run answers a question if the question plans it, which its id says: names and folders do not
count. So a run of somebody else's question, or one with a setting of its own, answers none.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from msgdrop_cli.analysis.curves import smooth_curve
from msgdrop_cli.analysis.metrics import metrics_of
from msgdrop_cli.analysis.reproduction import Answer
from msgdrop_cli.analysis.summary import Summary, check_readable, summarise
from msgdrop_cli.commands.parts.carry_out import as_planned
from msgdrop_cli.commands.parts.find_references import references_of
from msgdrop_cli.definition.catalogue import Catalogue
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.readings import apart, readings_of, under
from msgdrop_cli.definition.run_id import run_ids
from msgdrop_cli.definition.spec import Definition, PlannedRun
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.counted import by_run_id, preferred
from msgdrop_cli.records.elsewhere import read_elsewhere, studies_in
from msgdrop_cli.records.folders import run_folders
from msgdrop_cli.records.remembering import remembering
from msgdrop_cli.records.store import RunRecord, list_runs
from msgdrop_cli.report.write import home_of


class Scale(NamedTuple):
    """How a question was asked."""

    profile: str
    readings: tuple[str, ...]

    @property
    def name(self) -> str:
        """What records call it."""
        return under(self.profile, self.readings)


class Unreadable(NamedTuple):
    """A run that is left out because it is damaged."""

    path: Path
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """The questions with their runs, and what answers none."""

    answers: tuple[Answer, ...]
    records: tuple[RunRecord, ...]
    """Those that answer a question, by the names of the first that plans them."""
    others: tuple[RunRecord, ...]
    """Those that answer none."""
    unreadable: tuple[Unreadable, ...]
    scales: Mapping[str, Scale]
    """By the profile's name in the records."""
    copies: Mapping[str, Sequence[RunRecord]]
    """Of every run by its id, in no order; none that is told of as unreadable."""


def readable_runs(root: Path) -> tuple[list[RunRecord], list[Unreadable]]:
    """Every run in or below a folder, and those that a study in it names in another one.

    A damaged record is no reason to show none.

    Raises RecordError for a folder that is not there or cannot be read.
    """
    records, unreadable = [], []
    own = [(folder, list_runs) for folder in run_folders(root).runs]
    named = [(study, read_elsewhere) for study in studies_in(root)]
    for folder, read in (*own, *named):
        try:
            records += read(folder)
        except RecordError as error:
            unreadable.append(Unreadable(folder, str(error)))
    return remembering(records, home_of(root)), unreadable


def find_answers(root: Path, definitions: Sequence[Definition], catalogue: Catalogue) -> Answers:
    """Sort the runs of a results folder into the questions that plan them.

    Raises RecordError for a folder that cannot be read; damaged runs are told of instead.
    """
    records, unreadable = readable_runs(root)
    while True:
        matched = [_Matched(definition, records, catalogue) for definition in definitions]
        used, damaged = _checked(matched)
        if not damaged:
            break
        unreadable += damaged  # and another copy of its run may be sound
        paths = {each.path for each in damaged}
        records = [record for record in records if record.path not in paths]
    summary = summarise(used, references=references_of(used, root))
    answers = tuple(
        Answer(definition=definition, summary=_of(definition, each.ids, summary))
        for definition, each in zip(definitions, matched, strict=True)
    )
    ids = {record.run_id for record in used}
    once = {record.run_id: record for record in used}
    return Answers(
        answers=answers,
        records=tuple(once.values()),
        others=tuple(r for r in records if r.run_id not in ids),
        unreadable=tuple(unreadable),
        scales={scale.name: scale for each in matched for scale in each.scales},
        copies=by_run_id(records),
    )


def whole(definition: Definition) -> Definition:
    """The question with all of its games and variants in every profile, as its figures ask it."""
    profiles = {
        name: replace(profile, environments=None, variants=None)
        for name, profile in definition.profiles.items()
    }
    return replace(definition, profiles=profiles)


class _Matched:
    """The records that a question plans, by its names."""

    def __init__(
        self, definition: Definition, records: Sequence[RunRecord], catalogue: Catalogue
    ) -> None:
        by_id = by_run_id(records)
        seeds = sorted({record.seed for record in records})
        self.records: list[RunRecord] = []
        self.ids: set[tuple[str, str, str]] = set()
        self.scales: list[Scale] = []
        for scale in _scales(definition, records):
            mine = 0
            for planned in _planned(definition, scale, catalogue, seeds):
                for run_id in run_ids(planned.spec, seeds):
                    copies = by_id.pop(run_id, ())  # once: the scale most records name
                    for record in preferred(copies, definition.name)[:1]:
                        self.records.append(as_planned(record, planned))
                        self.ids.add((run_id, planned.variant, planned.profile))
                        mine += 1
            if mine:
                self.scales.append(scale)


def _scales(definition: Definition, records: Sequence[RunRecord]) -> list[Scale]:
    """The question's profiles, and those under readings that records name; the most named first."""
    named = Counter(record.profile for record in records)
    known = readings_of(definition.environments).keys()
    scales = {Scale(profile, ()): named[profile] for profile in definition.profiles}
    for name in named.keys() - definition.profiles.keys():
        scale = Scale(*apart(name, definition.profiles))
        if scale.readings and known >= set(scale.readings) and scale.name == name:
            scales[scale] = named[name]
    return sorted(scales, key=lambda scale: (-scales[scale], len(scale.readings)))


def _planned(
    definition: Definition, scale: Scale, catalogue: Catalogue, seeds: Sequence[int]
) -> Sequence[PlannedRun]:
    """The runs of a scale for the first of these seeds, from which others differ by theirs."""
    if not seeds:
        return ()
    return plan(
        whole(definition), scale.profile, catalogue, readings=scale.readings, seeds=seeds[:1]
    ).runs


def _checked(matched: Iterable[_Matched]) -> tuple[list[RunRecord], list[Unreadable]]:
    """The runs that some question plans, once by each name; and those whose logs are damaged."""
    found: dict[tuple[str, str, str], RunRecord] = {}
    for record in (record for each in matched for record in each.records):
        found.setdefault((record.run_id, record.variant, record.profile), record)
    damaged: dict[Path, Unreadable] = {}
    for record in found.values():
        try:
            _read_logs(record)
        except RecordError as error:
            damaged.setdefault(record.path, Unreadable(record.path, str(error)))
    return list(found.values()), list(damaged.values())


def _read_logs(record: RunRecord) -> None:
    if record.status == "done":
        smooth_curve(record, metrics_of(record).headline.name)
    check_readable(record)


def _of(definition: Definition, ids: set[tuple[str, str, str]], summary: Summary) -> Summary:
    """The arms whose runs are among these, by the question's labels and in its order."""
    named = {each[1:] for each in ids}
    arms = [
        replace(arm, label=definition.variants[arm.variant].label)
        for arm in summary.arms
        if (arm.variant, arm.group.profile) in named
        and {(run.run_id, arm.variant, arm.group.profile) for run in arm.done} <= ids
    ]
    order = list(definition.variants)
    arms.sort(key=lambda arm: (arm.group, order.index(arm.variant)))
    return replace(summary, arms=tuple(arms))
