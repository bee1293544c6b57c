"""`msgdrop config show`: every setting of a run, its value, and where that comes from."""

from collections.abc import Sequence
from typing import Annotated, Any

import typer

from msgdrop_cli.commands.parts import completion, console, options, sources, vocabulary
from msgdrop_cli.commands.parts.typed import as_typed
from msgdrop_cli.commands.train import PROFILES, check_profile
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import ad_hoc_definition, plan
from msgdrop_cli.definition.spec import Definition, RunSpec, record_name
from msgdrop_cli.errors import DefinitionError, nearest

app = typer.Typer()

_SHOW = "show"
_Env = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="The game.", autocompletion=completion.environments),
]
_Algorithm = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="For train.", autocompletion=completion.algorithms),
]
_Variant = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Of the question.", autocompletion=completion.variants),
]


@app.command(
    epilog=options.examples(
        "config show dropout-rate --variant md-0.5 --origin",
        "config show --algorithm fdc --set training.games=4 --json",
    )
)
def config(
    action: Annotated[
        str, typer.Argument(metavar=_SHOW, help="What to do.", autocompletion=lambda: [_SHOW])
    ],
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[NAME|FILE.toml]",
            help="The question; without one it is what train would do.",
            parser=options.question,
            autocompletion=completion.questions,
        ),
    ] = None,
    env: _Env = None,
    algorithm: _Algorithm = None,
    variant: _Variant = None,
    profile: options.Profile = None,
    overrides: options.Set = None,
    readings: options.Reading = None,
    origin: Annotated[
        bool, typer.Option("--origin", help="Where each value comes from, and its source.")
    ] = False,
    json: options.Json = False,
) -> int:
    """Show every resolved setting of a run; with --origin where its value comes from.

    Origins: default, paper settings, an algorithm's name, a question's profile or variant,
    --reading, --set. Sources are lines of the paper, or ours (PAPER.md).
    """
    if action != _SHOW:
        raise DefinitionError(f"config: expected {_SHOW}, not {action[:40]!r}")
    if name is not None and algorithm is not None:
        raise DefinitionError("--algorithm is for train; of a question choose a --variant")
    with as_typed():
        rows = _rows(
            _question(name, env, algorithm, profile), env, variant, profile, overrides, readings
        )
    if json:
        console.result_json(rows)
        return 0
    said = {
        f"{row['setting']}={sources.notation(row['value'])}": "; ".join(
            filter(None, (row["origin"], row["source"]))
        )
        if origin
        else row["meaning"]
        for row in rows
    }
    console.facts(said, is_result=True)
    return 0


def _question(
    name: str | None, env: str | None, algorithm: str | None, profile: str | None
) -> Definition:
    if name is not None:
        return load_definition(name)
    scale = profile or "quick"
    check_profile(scale)
    names = [algorithm or "dcc-md"]
    return ad_hoc_definition(env or "pursuit-n6", names, scale, PROFILES[scale])


def _rows(
    definition: Definition,
    env: str | None,
    variant: str | None,
    profile: str | None,
    overrides: list[str] | None,
    readings: list[str] | None,
) -> list[dict[str, Any]]:
    """A row a setting of the one run that is meant; loads torch."""
    from msgdrop_cli.commands.parts.early import check_early

    scale = options.chosen_profile(definition, profile)
    changes, others = overrides or (), readings or ()
    check_early(definition, scale, overrides=changes, readings=others)
    from msgdrop_cli.definition.origins import DEFAULT, game_of, origins, papers_spec
    from msgdrop_cli.engine.offers import catalogue

    known = catalogue()
    runs = plan(definition, scale, known, overrides=changes, readings=others).runs
    games = [run.spec.environment for run in runs]
    game = _one_of("--env", env and record_name(env), games)
    arm = _one_of("--variant", variant, [run.variant for run in runs])
    [run, *_] = [each for each in runs if (each.spec.environment, each.variant) == (game, arm)]
    console.note(f"as {run.label} on {run.spec.environment} has them, profile {run.profile}\n")
    told = origins(run, definition, scale, known, overrides=changes, readings=others)
    configs = _configs(run.spec)
    papers = _configs(papers_spec(run, definition, scale, known))
    learner = str(definition.variants[run.variant].algorithm["name"])
    return [
        {
            "setting": f"{section.name}.{s.key}",
            "value": getattr(configs[section.name], s.key),
            "origin": told.get(f"{section.name}.{s.key}", DEFAULT),
            "source": _source(
                s, getattr(configs[section.name], s.key), getattr(papers[section.name], s.key)
            ),
            "meaning": s.meaning,
        }
        for section in vocabulary.sections(game_of(run, definition), learner)
        for s in section.settings
    ]


def _configs(spec: RunSpec) -> dict[str, Any]:
    """The settings by the section of their paths."""
    return {
        "training": spec.training,
        "algorithm": spec.algorithm_config,
        "environment": spec.environment_config,
    }


def _source(setting: sources.Setting, value: Any, papers: Any) -> str:
    """Where the paper has a value; one that the run has not is named beside it."""
    if value == papers:
        return setting.source
    by = f" ({setting.source})" if setting.source else ""
    return f"instead of {sources.notation(papers)}{by}"


def _one_of(option: str, asked: str | None, there: Sequence[str]) -> str:
    """The one that is asked for, or the first."""
    if asked is not None and asked not in there:
        raise DefinitionError(f"{option}: {asked[:64]!r} is not asked; {nearest(asked, {*there})}")
    return asked or there[0]
