"""`msgdrop publish`: finished runs of a question as small records, tables and figures to commit."""

from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.errors import DefinitionError

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

    The numbers of every run go along, the policy of each variant's lowest seed, tables, figures.
    """
    definition = load_definition(name)
    profile = options.chosen_profile(definition, profile)
    chosen = options.chosen_seeds(seed, seeds)
    from msgdrop_cli.analysis.claims import judge_claims
    from msgdrop_cli.analysis.summary import summarise
    from msgdrop_cli.commands.parts.carry_out import as_planned
    from msgdrop_cli.commands.parts.find_references import references_of
    from msgdrop_cli.commands.parts.show_report import note_left_out
    from msgdrop_cli.commands.parts.survey import survey
    from msgdrop_cli.engine.offers import catalogue
    from msgdrop_cli.report.figures import draw_all
    from msgdrop_cli.report.study import publish as copy
    from msgdrop_cli.report.study import tables
    from msgdrop_cli.report.write import FIGURES, TABLES, Folder, write_atomic

    asked = plan(definition, profile, catalogue(), readings=reading or (), seeds=chosen)
    looked_up = survey(asked.runs, results)
    records = [
        as_planned(looked_up.records[run.run_id], run)
        for run in looked_up.runs
        if looked_up.status(run) == "done"
    ]
    if not records:
        what = f"{results}: holds no finished run of {definition.name}, profile {asked.profile}"
        raise DefinitionError(f"{what} (train them: {_command(name, profile, reading or ())})")
    folder = Folder(to).at(f"{definition.name}-{asked.profile}")
    order = tuple(definition.variants)
    summary = summarise(records, order=order, references=references_of(records, folder.made()))
    note_left_out(summary)
    text = tables(summary, judge_claims(asked.claims, summary, definition))
    copies = copy(records, folder)  # what cannot be summarised is not published
    page = write_atomic(folder, TABLES, text.encode())
    drawn = draw_all(summary, folder.at(FIGURES))
    _show({"runs": copies, "tables": [page], "figures": drawn}, as_json=json)
    return 0


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
