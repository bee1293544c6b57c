"""What `verify` finds: published studies made again, and own runs against themselves.

Nothing is written but in a scratch folder, and no code of other people is run.
"""

from collections.abc import Iterator, Sequence
from os.path import lexists
from pathlib import Path
from typing import NamedTuple

from msgdrop_cli.commands.parts.sound import (
    check_episodes,
    check_policy,
    check_record,
    check_windows,
)
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.load import list_askable, load_definition
from msgdrop_cli.definition.run_id import spec_from_dict
from msgdrop_cli.definition.spec import Definition
from msgdrop_cli.errors import DefinitionError, MsgdropError, RecordError
from msgdrop_cli.records.copies import FILES
from msgdrop_cli.records.counted import PUBLISHED
from msgdrop_cli.records.elsewhere import ELSEWHERE, read_elsewhere
from msgdrop_cli.records.folders import folders_with, run_folders
from msgdrop_cli.records.own_sums import RUN_SUMS, run_differences
from msgdrop_cli.records.packed import log_file
from msgdrop_cli.records.references import REFERENCES, find_references, game_key
from msgdrop_cli.records.remembering import remembering
from msgdrop_cli.records.store import EPISODES, POLICY, RunRecord, list_runs
from msgdrop_cli.records.sums import SUMS, Difference, differences, sums_of
from msgdrop_cli.report.compare import difference, is_compared
from msgdrop_cli.report.study import study_of, write_study
from msgdrop_cli.report.write import TABLES, Folder


class Verified(NamedTuple):
    """One place that was looked at."""

    place: Path
    looked_at: str
    """What was, in words."""
    differences: tuple[Difference, ...]
    not_compared: tuple[str, ...] = ()
    """In words, with the reason."""


def verified(root: Path, scratch: Path) -> Iterator[Verified]:
    """Look through a results folder, or a part of it: study by study, then the other runs.

    A study is a folder that lists its files, or that has a page of tables. scratch: an empty
    folder. Raises RecordError if there is nothing to look at, or `root` is a part of a study.
    """
    for whole in root.resolve().parents:
        if lexists(whole / SUMS) and lexists(whole / TABLES):  # not any list of downloads
            raise RecordError(
                f"{root}: is a part of {whole}, which can only be verified as a whole"
            )
    found = run_folders(root)
    studies = folders_with(root, (SUMS, TABLES))
    if not studies and not found.runs:
        raise RecordError(f"{root}: holds nothing of msgdrop that could be verified")
    for number, folder in enumerate(studies):
        yield _study(folder, Folder(scratch).at(str(number)), root)
    if others := [run for run in found.runs if not set(run.parents) & set(studies)]:
        yield _others(root, others)


def _study(folder: Path, scratch: Folder, root: Path) -> Verified:
    """One published folder: its files, its runs, and all that is made of them.

    Runs in other studies are checked with those, if they are below `root`, too.
    """
    looked_at, not_compared = "", list[str]()
    try:
        changed = [*differences(folder)]
        if lexists(folder / SUMS):
            looked_at = several(len(sums_of(folder)), "file")
        if changed:
            return Verified(folder, looked_at, tuple(changed))
        records = remembering([list_runs(each)[0] for each in run_folders(folder).runs], None)
        elsewhere = remembering(read_elsewhere(folder), None)
        if not (every := [*records, *elsewhere]):
            return Verified(folder, looked_at, ())
        for record in every:
            if record in records or root.resolve() not in record.path.parents:
                not_compared += _checked(record)
        made, unmade = _made_again(folder, records, elsewhere, scratch)
        not_compared += unmade
        runs = several(len(every), "run")
        looked_at += f"; {len(made)} of them made again from {runs}"
        looked_at += f", {len(elsewhere)} in other studies" if elsewhere else ""
        changed += [*_compared(folder, made)]
        not_compared += _left_out(folder, made)
        if made:
            changed += _strangers(folder, every, {*made, SUMS, ELSEWHERE})
    except (DefinitionError, RecordError) as error:
        return Verified(folder, looked_at, (_unreadable(folder, error),))
    return Verified(folder, looked_at, tuple(changed), tuple(dict.fromkeys(not_compared)))


def _made_again(
    folder: Path,
    records: Sequence[RunRecord],
    elsewhere: Sequence[RunRecord],
    scratch: Folder,
) -> tuple[dict[str, Path], list[str]]:
    """What these runs give, by its name in the published folder; or in words why nothing can be."""
    every = [*records, *elsewhere]
    asked = {(record.definition, record.profile) for record in every}
    if len(asked) > 1:
        names = " and ".join("-".join(each) for each in sorted(asked))
        raise RecordError(f"{folder}: holds runs of {names}; expected those of one question")
    [(name, profile)] = asked
    question = _question(folder, name)
    if question is None:
        why = f"the question {name} is not known here, and no {name}.toml lies beside its runs"
        return {}, [f"tables and figures ({why})"]
    games = {game_key(each.setup.environment) for each in every if each.setup}
    known = {key: find_references(folder, key) for key in games}
    references = {key: each for key, each in known.items() if each is not None}
    written = write_study(study_of(records, question, profile, references, elsewhere), scratch)
    root = scratch.made()
    return {
        each.relative_to(root).as_posix(): each for each in (written.page, *written.figures)
    }, []


def _question(folder: Path, name: str) -> Definition | None:
    """The one that lies beside the runs, or else the one that is shipped, if there is one.

    Raises DefinitionError if it cannot be read.
    """
    beside = folder / f"{name}.toml"
    if beside.is_file() and not beside.is_symlink():
        return load_definition(str(beside))
    return load_definition(name) if name in list_askable() else None


def _checked(record: RunRecord) -> list[str]:
    """What of a finished run cannot be compared, in words; RecordError if something is wrong."""
    from msgdrop_cli.engine.offers import catalogue

    check_windows(record)
    is_played = lexists(log_file(record.path / EPISODES))
    if is_played or not record.is_own:
        check_episodes(record)
    try:
        spec = spec_from_dict(record.spec, catalogue())
        check_record(record, spec)
        if lexists(record.path / POLICY):
            check_policy(record, spec)
    except DefinitionError as error:
        return [f"settings and policy of {record.path.name} ({error})"]
    return [] if is_played else [f"evaluation of {record.path.name} (not played yet)"]


def _compared(folder: Path, made: dict[str, Path]) -> Iterator[Difference]:
    for name, file in made.items():
        if not lexists(folder / name):
            yield Difference(folder / name, "file", "one", "none")
        elif (found := difference(file, folder / name)) is not None:
            yield found


def _left_out(folder: Path, made: dict[str, Path]) -> list[str]:
    """Figures whose bytes say nothing."""
    others = [
        name
        for name, file in made.items()
        if lexists(folder / name) and not is_compared(file, folder / name)
    ]
    why = "other bytes, and not said to be drawn by the matplotlib that is here"
    return [f"{several(len(others), 'figure')} ({why})"] if others else []


def _strangers(folder: Path, records: Sequence[RunRecord], made: set[str]) -> list[Difference]:
    """Listed files that are neither records nor made of them."""
    ours = {record.path / name for record in records for name in FILES}
    [name] = {record.definition for record in records}
    question = _question(folder, name)
    ours |= {folder / f"{name}.toml", *(question.traces if question else ())}
    games = {game_key(record.setup.environment) for record in records if record.setup}
    ours |= {folder / REFERENCES / f"{key}.json" for key in games}
    return [
        Difference(folder / name, "file", "none, for no record gives it", "one")
        for name in sums_of(folder)
        if name not in made and folder / name not in ours
    ]


def _others(root: Path, folders: Sequence[Path]) -> Verified:
    """Runs outside of what is published: their files fit each other and the list of the run."""
    found, not_compared = list[Difference](), list[str]()
    finished = unfinished = without = 0
    for folder in folders:
        within = folder.relative_to(root)
        try:
            [record] = list_runs(folder)
            if not record.is_own and PUBLISHED in (root.resolve().name, *within.parts):
                found.append(Difference(folder, "run", f"one in a folder with {SUMS}", "it alone"))
            if record.status == "done":
                finished += 1
                not_compared += _checked(record)
            else:
                unfinished += 1
            if lexists(folder / RUN_SUMS):
                found += run_differences(folder)
            else:
                without += record.status == "done"
        except RecordError as error:
            found.append(_unreadable(folder, error))
    if unfinished:
        not_compared.append(f"{several(unfinished, 'run')} (not finished)")
    if without:
        runs = several(without, "finished run")
        not_compared.append(f"digests of {runs} (no {RUN_SUMS}: an earlier version finished it)")
    words = f"{several(finished, 'finished run')}, each against its own record and list"
    return Verified(root, words, tuple(found), tuple(not_compared))


def _unreadable(folder: Path, error: MsgdropError) -> Difference:
    said = str(error).replace(f"{folder}/", "")
    return Difference(folder, "record", "a sound one", said)
