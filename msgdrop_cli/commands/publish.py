"""`msgdrop publish`: finished runs of a question as small records, tables and figures to commit."""

import os
import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.figures import all_figures
from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.plan import Plan, plan
from msgdrop_cli.definition.readings import all_readings
from msgdrop_cli.definition.spec import Definition
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.copies import same_logs
from msgdrop_cli.records.counted import copies_of, preferred
from msgdrop_cli.records.elsewhere import keep_elsewhere, read_elsewhere, runs_beside
from msgdrop_cli.records.files import read_bytes, write_bytes_atomic
from msgdrop_cli.records.store import ENDED, RUN, RunRecord, list_runs
from msgdrop_cli.records.sums import check_listable, list_sums, sums_of
from msgdrop_cli.report.write import FIGURES, Folder

app = typer.Typer()
_To = Annotated[
    Path, typer.Option(metavar="DIR", help="Where published records are kept.", parser=options.path)
]


@app.command(
    epilog=options.examples(
        "publish dropout-rate --profile million", "publish my-question.toml --seed 7 --to published"
    )
)
def publish(
    name: options.Question,
    profile: options.Profile = None,
    reading: options.Reading = None,
    seed: options.Seed = None,
    seeds: options.Seeds = None,
    results: options.Results = Path("results"),
    to: _To = Path("results/published"),
    json: options.Json = False,
) -> int:
    """Copy a question's finished runs to be committed.

    The numbers of every run go along, the policy of each variant's lowest seed; a copy that says
    the same stays, even if its policy was taken out, and no run of yours with fewer episodes takes
    its place. Runs that another study in the same folder has are named (elsewhere.json), not
    copied. Tables and figures are of all runs that are published then, those of before included;
    SHA256SUMS lists every file.
    """
    options.check_place(to, "--to")
    definition = load_definition(name)
    _check(definition, reading or ())
    traces = _traces(definition)
    profile = options.chosen_profile(definition, profile)
    chosen = options.chosen_seeds(seed, seeds)
    from msgdrop_cli.commands.parts.find_references import references_of
    from msgdrop_cli.commands.parts.show_report import note_left_out
    from msgdrop_cli.engine.offers import catalogue
    from msgdrop_cli.report.study import publish as copy
    from msgdrop_cli.report.study import study_of, write_study

    asked = plan(definition, profile, catalogue(), readings=reading or (), seeds=chosen)
    folder = Folder(to).at(f"{definition.name}-{asked.profile}")
    records, elsewhere = _runs(asked, results, to.joinpath(folder.inside))
    if not records and not elsewhere:
        what = f"{results}: holds no finished run of {definition.name}, profile {asked.profile}"
        wanted = _command(name, profile, reading or (), chosen, results)
        raise DefinitionError(f"{what} (train them: {wanted})")
    references = references_of([*records, *elsewhere], folder.made(), kept_in=folder.made())
    study = study_of(records, definition, asked.profile, references, elsewhere)
    note_left_out(study.summary)
    check_listable(folder.made())
    copies = copy(records, folder, elsewhere)  # what cannot be summarised is not published
    named = keep_elsewhere(folder.made(), elsewhere)
    written = write_study(study, folder)
    _keep_question(definition, traces, folder.made())
    _remove_stale(folder.made(), written.figures)
    made = {"runs": copies, "elsewhere": named, "tables": [written.page]}
    made |= {"figures": written.figures}
    _show({**made, "sums": [list_sums(folder.made())]}, as_json=json)
    return 0


class _Runs(NamedTuple):
    """What a study is of."""

    here: list[RunRecord]
    """Those that are to lie in its folder, or do."""
    elsewhere: list[RunRecord]
    """Those that lie in another study beside it."""


def _runs(asked: Plan, results: Path, study: Path) -> _Runs:
    """The plan's finished runs, by its names, and those that are published already."""
    from msgdrop_cli.commands.parts.carry_out import as_planned
    from msgdrop_cli.commands.parts.sound import check_windows

    there = list_runs(study) if any(study.glob(f"*/*/{RUN}")) else []
    kept = {record.run_id: record for record in there}
    named = {record.run_id: record for record in read_elsewhere(study)}
    copies = copies_of(results, {run.run_id for run in asked.runs})
    beside = runs_beside(study, {run.run_id for run in asked.runs})
    here: dict[str, RunRecord] = {}
    poorer: list[RunRecord] = []
    for run in asked.runs:
        published = kept.get(run.run_id) or named.get(run.run_id)
        found = preferred(copies.get(run.run_id, ()))
        lacking = [each for each in found if _is_poorer(each, published)]
        poorer += lacking
        best = [each for each in found if each not in lacking]
        own = best[0] if best and best[0].is_own and best[0].status in ENDED else None
        if published and own:
            _refuse_diverged(own, published)
        if run.run_id in kept:
            if own:
                here[run.run_id] = as_planned(own, run)
        elif lies := [each for each in preferred(beside.get(run.run_id, ())) if _alike(each, own)]:
            named[run.run_id] = as_planned(lies[0], run)
        elif best and best[0].status == "done":
            here[run.run_id] = as_planned(best[0], run)
    if poorer:
        why = "not evaluated yet, or with fewer episodes than its published copy"
        console.note(f"passed over: {several(len(poorer), 'run')} of yours, {why}")
    for record in here.values():
        if record.status == "done":  # nothing is copied of which one log is not whole
            check_windows(record)
    here |= {run_id: record for run_id, record in kept.items() if run_id not in here}
    return _Runs([*here.values()], [each for run_id, each in named.items() if run_id not in here])


def _is_poorer(record: RunRecord, published: RunRecord | None) -> bool:
    """Whether it is an own finished run that lacks episodes: all, or some that are published."""
    if not record.is_own or record.status != "done":
        return False
    played, there = record.episodes(), dict[Channel, Sequence[Any]]()
    with suppress(RecordError):  # of a damaged copy nothing is kept
        there |= published.episodes() if published else {}
    fewer = (len(played.get(channel, ())) < len(rows) for channel, rows in there.items())
    return not played or any(fewer)


def _alike(published: RunRecord, own: RunRecord | None) -> bool:
    """Whether the published copy can stand for an own one: it was made of it, or there is none."""
    if own is None:
        return True
    return published.status == own.status and same_logs(published, own)


def _refuse_diverged(own: RunRecord, published: RunRecord) -> None:
    """RecordError if it diverged here, which one of the two has to be wrong about."""
    if own.status != "done":
        problem = f"it is published as {published.status}: remove the copy that is wrong"
        raise RecordError(f"{own.path}: {own.status}, and {published.path}: {problem}")


def _keep_question(definition: Definition, traces: Mapping[str, Path], folder: Path) -> None:
    """Who verifies has the questions that are shipped, and needs any other one, with its traces."""
    if not definition.shipped:
        content = Path(definition.file).read_bytes()
        write_bytes_atomic(folder / f"{definition.name}.toml", content)
    for place, trace in traces.items():
        copy = folder / place
        copy.parent.mkdir(parents=True, exist_ok=True)
        write_bytes_atomic(copy, read_bytes(trace))


def _check(definition: Definition, readings: Sequence[str]) -> None:
    """DefinitionError for what would take another study's place, or say what it does not mean."""
    known = all_readings()
    if evaluated := [each for each in readings if each in known and known[each].evaluation_epsilon]:
        raise DefinitionError(f"--reading {evaluated[0]}: it changes no run: publish without it")
    if not definition.shipped and definition.name in (*list_definitions(), *all_figures()):
        raise DefinitionError(
            f"{definition.file}: a question that is shipped is called {definition.name}, and this"
            " would take the place of its study: call the file otherwise, or publish by the name"
        )


def _traces(definition: Definition) -> dict[str, Path]:
    """The traces of a question by where they lie from its file; DefinitionError for another place.

    A copy of the question could not name it.
    """
    home = Path(definition.file).parent
    places = {os.path.relpath(trace, home): trace for trace in definition.traces}
    for place, trace in places.items():
        if Path(place).parts[0] == os.pardir:
            raise DefinitionError(
                f"{definition.file}: names the trace {trace}: to be published it has to lie beside"
                " or below the question"
            )
    return places


def _remove_stale(folder: Path, drawn: Sequence[Path]) -> None:
    """Remove the figures that were published before and are no longer made of these runs."""
    before: dict[str, str] = {}
    with suppress(RecordError):  # there is no list, or a damaged one, which is written anew
        before = sums_of(folder)
    for path in (folder / FIGURES).glob("*"):
        if path not in drawn and f"{FIGURES}/{path.name}" in before:
            path.unlink()


def _command(
    name: str, profile: str, readings: Sequence[str], seeds: Sequence[int] | None, results: Path
) -> str:
    """What trains the runs that are to be published."""
    words = ["msgdrop", "ablate", name, "--profile", profile]
    words += [word for each in readings for word in ("--reading", each)]
    words += ["--seeds", "".join(f"{seed}," for seed in seeds)] if seeds else []
    words += ["--results", str(results)] if results != Path("results") else []
    return shlex.join(words)


def _show(paths: Mapping[str, Sequence[Path]], *, as_json: bool) -> None:
    if as_json:
        console.result_json({kind: [str(each) for each in paths[kind]] for kind in paths})
        return
    for path in chain.from_iterable(paths.values()):
        console.result(str(path))
