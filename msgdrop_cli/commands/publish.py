"""`msgdrop publish`: finished runs of a question as small records, tables and figures to commit."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import Plan, plan
from msgdrop_cli.definition.spec import Definition
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.counted import copies_of, preferred
from msgdrop_cli.records.files import write_bytes_atomic
from msgdrop_cli.records.store import RUN, RunRecord, list_runs
from msgdrop_cli.records.sums import list_sums, listed
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

    The numbers of every run go along, the policy of each variant's lowest seed. Tables and figures
    are of all runs that are published then, those of before included; SHA256SUMS lists every file.
    """
    options.check_place(to, "--to")
    definition = load_definition(name)
    profile = options.chosen_profile(definition, profile)
    chosen = options.chosen_seeds(seed, seeds)
    from msgdrop_cli.commands.parts.find_references import references_of
    from msgdrop_cli.commands.parts.show_report import note_left_out
    from msgdrop_cli.engine.offers import catalogue
    from msgdrop_cli.report.study import publish as copy
    from msgdrop_cli.report.study import study_of, write_study

    asked = plan(definition, profile, catalogue(), readings=reading or (), seeds=chosen)
    folder = Folder(to).at(f"{definition.name}-{asked.profile}")
    records = _runs(asked, results, to.joinpath(folder.inside))
    if not records:
        what = f"{results}: holds no finished run of {definition.name}, profile {asked.profile}"
        raise DefinitionError(f"{what} (train them: {_command(name, profile, reading or ())})")
    references = references_of(records, folder.made(), kept_in=folder.made())
    study = study_of(records, definition, asked.profile, references)
    note_left_out(study.summary)
    copies = copy(records, folder)  # what cannot be summarised is not published
    written = write_study(study, folder)
    _keep_question(definition, folder.made())
    _remove_stale(folder.made(), written.figures)
    made = {"runs": copies, "tables": [written.page], "figures": written.figures}
    _show({**made, "sums": [list_sums(folder.made())]}, as_json=json)
    return 0


def _runs(asked: Plan, results: Path, published: Path) -> list[RunRecord]:
    """The plan's finished runs, by its names, and those that are published already."""
    from msgdrop_cli.commands.parts.carry_out import as_planned

    copies = copies_of(results, {run.run_id for run in asked.runs})
    own: dict[str, RunRecord] = {}
    for run in asked.runs:
        for record in preferred(copies.get(run.run_id, ()))[:1]:
            if record.is_own and record.status == "done":
                own.setdefault(run.run_id, as_planned(record, run))
    there = list_runs(published) if any(published.glob(f"*/*/{RUN}")) else []
    kept = [record for record in there if record.run_id not in own]
    return [*own.values(), *kept]


def _keep_question(definition: Definition, folder: Path) -> None:
    """Who verifies has the questions that are shipped, and needs any other one."""
    if not definition.shipped:
        content = Path(definition.file).read_bytes()
        write_bytes_atomic(folder / f"{definition.name}.toml", content)


def _remove_stale(folder: Path, drawn: Sequence[Path]) -> None:
    """Remove the figures that were published before and are no longer made of these runs."""
    before: dict[str, str] = {}
    with suppress(RecordError):  # there is no list, or a damaged one, which is written anew
        before = listed(folder)
    for path in (folder / FIGURES).glob("*"):
        if path not in drawn and f"{FIGURES}/{path.name}" in before:
            path.unlink()


def _command(name: str, profile: str, readings: Sequence[str]) -> str:
    """What trains the runs that are to be published."""
    under = "".join(f" --reading {each}" for each in readings)
    return f"msgdrop ablate {name} --profile {profile}{under}"


def _show(paths: Mapping[str, Sequence[Path]], *, as_json: bool) -> None:
    if as_json:
        console.result_json({kind: [str(each) for each in paths[kind]] for kind in paths})
        return
    for path in chain.from_iterable(paths.values()):
        console.result(str(path))
