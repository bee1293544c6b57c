"""`msgdrop ablate`: answer a question by training its variants."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import console, options, settings
from msgdrop_cli.definition.figures import all_figures
from msgdrop_cli.definition.load import list_askable, list_definitions, load_definition
from msgdrop_cli.definition.readings import all_readings, as_overrides, readings_of
from msgdrop_cli.definition.spec import Definition
from msgdrop_cli.errors import DefinitionError

app = typer.Typer()


_Name = Annotated[
    str | None,
    typer.Argument(
        metavar="[NAME|FILE.toml]",
        help="A question, the paper's figure-3a or another, or your own file; leave it out to "
        "list what is shipped.",
        parser=options.question,
        autocompletion=list_askable,
    ),
]
_Lists = Annotated[bool, typer.Option("--list", help="List questions, figures and readings.")]


def _emitted(text: str) -> str:
    if text not in _SCHEDULERS:
        raise typer.BadParameter(f"{text[:40]!r} is unknown; there is {', '.join(_SCHEDULERS)}")
    return text


_SCHEDULERS = ("slurm",)
_Emit = Annotated[
    str | None,
    typer.Option(
        metavar="slurm",
        help="Print a job array for this scheduler instead of training.",
        parser=_emitted,
        autocompletion=lambda: list(_SCHEDULERS),
    ),
]


@app.command(
    cls=settings.ListsReadings,
    epilog=options.examples(
        "ablate blockwise-vs-elementwise",
        "ablate dropout-rate --profile million --seeds 6 --dry-run",
        "ablate broken-links --profile two-million --seeds auto",
        "ablate broken-links --reading capture-once",
        "ablate dropout-rate --profile paper --emit slurm",
        "ablate my-question.toml --set help   (what --set takes here)",
    ),
)
def ablate(
    name: _Name = None,
    lists: _Lists = False,
    profile: options.Profile = None,
    reading: options.Reading = None,
    overrides: options.Set = None,
    seed: options.Seed = None,
    seeds: options.SeedsOrAuto = None,
    workers: options.Workers = options.WORKERS,
    device: options.Device = "cpu",
    results: options.Results = Path("results"),
    cluster: options.Cluster = None,
    cluster_tls: options.ClusterTls = None,
    dry_run: options.DryRun = False,
    emit: _Emit = None,
    json: options.Json = False,
) -> int:
    """Answer a question: train, evaluate, compare, draw.

    What is finished or published in the results folder is not trained again; what was interrupted
    goes on from its checkpoint.
    """
    if name is None and overrides:
        raise DefinitionError("--set: of which question? (all settings: msgdrop explain)")
    if name is None or lists:
        return _list(json)
    definition = load_definition(name)
    checked = options.train_options(
        profile=_profile(definition, profile, reading or ()),
        readings=reading,
        overrides=overrides,
        seed=seed,
        seeds=seeds,
        workers=workers,
        device=device,
        results=results,
        dry_run=dry_run,
        json=json,
        cluster=cluster,
        cluster_tls=cluster_tls,
    )
    settings.check(definition, checked)
    if settings.HELP in checked.overrides:
        return settings.show_settings(definition, checked, as_json=json)
    from msgdrop_cli.commands.parts.carry_out import carry_out  # after the quick checks
    from msgdrop_cli.commands.parts.slurm import show_job_array

    if emit:
        return show_job_array(name, definition, checked)
    return carry_out(definition, checked)


def _profile(definition: Definition, profile: str | None, readings: Sequence[str]) -> str:
    """The profile that is meant; refuses it and readings, as the plan would, but before torch."""
    name = options.chosen_profile(definition, profile)
    as_overrides(readings, definition.games(name))
    return name


def _list(as_json: bool) -> int:
    definitions = [load_definition(name) for name in list_definitions()]
    figures = all_figures()
    if as_json:
        console.result_json(
            [
                {
                    "name": d.name,
                    "title": d.title,
                    "question": d.question,
                    "source": d.source,
                    "figures": [name for name, each in figures.items() if each.question == d.name],
                    "readings": list(readings_of(d.environments)),
                }
                for d in definitions
            ]
        )
        return 0
    console.facts({d.name: d.question for d in definitions}, is_result=True)
    console.result("\nfigures of the paper, each a part of one of these:")
    console.facts({name: each.shows for name, each in figures.items()}, is_result=True)
    console.result("\nother readings of the paper, for --reading:")
    console.facts({name: each.says for name, each in all_readings().items()}, is_result=True)
    console.note("\nanswer one:  msgdrop ablate NAME   (what it takes: --dry-run)")
    return 0
