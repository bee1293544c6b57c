"""`msgdrop train`: one named algorithm on one environment, outside any question."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import completion, options, settings, words
from msgdrop_cli.commands.parts.typed import as_typed
from msgdrop_cli.definition.catalogue import check_algorithm
from msgdrop_cli.definition.plan import AD_HOC, ad_hoc_definition
from msgdrop_cli.definition.spec import Definition, Profile
from msgdrop_cli.errors import DefinitionError, nearest

app = typer.Typer()

PROFILES: Mapping[str, Profile] = MappingProxyType(
    {
        "quick": Profile(seeds=1, evaluation_episodes=200, training={"train_env_steps": 100_000}),
        "million": Profile(seeds=1, training={"train_env_steps": 1_000_000}),
        "paper": Profile(seeds=1),
    }
)
"""The scales of the shipped questions, with one seed."""
_Env = Annotated[
    str,
    typer.Option(
        metavar="NAME|PACKAGE.MODULE:FACTORY",
        help="The environment, or what makes a PettingZoo ParallelEnv.",
        autocompletion=completion.environments,
    ),
]
_Algorithm = Annotated[
    str, typer.Option(metavar="NAME", help="The algorithm.", autocompletion=completion.algorithms)
]
_Rate = Annotated[
    str | None, typer.Option(metavar="0.3|30%", help="Share of the messages dropped in training.")
]
_Channel = Annotated[
    str | None,
    typer.Option(
        metavar="KIND:SETTINGS",
        help="What messages go through in training, if it loses or delays them: loss:0.2, delay:3, "
        "bursts:0.2,4+hold:5.",
        autocompletion=completion.channels,
    ),
]
_Steps = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help="Env steps of the training, exploring for half of them at most.",
        parser=options.whole,
    ),
]
_Profile = Annotated[
    str,
    typer.Option(metavar="NAME", help=options.SCALE, autocompletion=lambda: list(PROFILES)),
]


@app.command(
    cls=settings.ListsSettings,
    epilog=options.examples(
        "train --rate 0.3 --steps 1e6 --seed 3",
        "train --algorithm dcc --channel delay:2",
        "train --env waterworld-n8 --algorithm ddpg --set algorithm.tau=0.05",
    ),
)
def train(
    env: _Env = "pursuit-n6",
    algorithm: _Algorithm = "dcc-md",
    rate: _Rate = None,
    channel: _Channel = None,
    steps: _Steps = None,
    profile: _Profile = "quick",
    overrides: options.Set = None,
    seed: options.Seed = None,
    seeds: options.Seeds = None,
    workers: options.Workers = options.WORKERS,
    device: options.Device = "cpu",
    results: options.Results = Path("results"),
    dry_run: options.DryRun = False,
    json: options.Json = False,
) -> int:
    """Train and evaluate one algorithm.

    What is finished is not trained again; what was interrupted goes on from its checkpoint.
    """
    checked = options.train_options(
        profile=profile,
        overrides=overrides,
        seed=seed,
        seeds=seeds,
        workers=workers,
        device=device,
        results=results,
        dry_run=dry_run,
        json=json,
    )
    check_profile(profile)
    options_of = {"algorithm.rate": rate, "training.train_env_steps": steps}
    _check_said_once(checked.overrides, {**options_of, "training.channel": channel})
    asked = [] if rate is None else [f"algorithm.rate={words.share(rate, '--rate')}"]
    asked += [] if channel is None else [f"training.channel={_through(channel)}"]
    checked = replace(checked, overrides=(*checked.overrides, *asked))
    if steps is not None and steps < 1:
        raise DefinitionError(f"--steps: expected at least 1, not {steps}")
    with as_typed(_own_options(rate, channel, steps)):
        definition = _definition(env, algorithm, profile, rate, steps)
        settings.check(definition, checked)
        if settings.HELP in checked.overrides:
            return settings.show_settings(definition, checked, as_json=json)
        from msgdrop_cli.commands.parts.carry_out import carry_out  # after the quick checks

        return carry_out(definition, checked)


def _own_options(rate: object, channel: object, steps: object) -> dict[str, str]:
    """What the options that are given stand for, as places in errors, and their names."""
    given = (
        (rate, "--set: algorithm.rate", "--rate"),
        (channel, "--set: training.channel", "--channel"),
        (steps, f"{AD_HOC}: profiles", "--steps"),
    )
    return {place: option for value, place, option in given if value is not None}


def check_profile(name: str) -> None:
    """Refuse (DefinitionError) a scale that `train` has not."""
    if name not in PROFILES:
        known = nearest(name[:64], PROFILES)
        raise DefinitionError(f"--profile: none is called {name[:64]!r}; {known}")


def _through(channel: str) -> str:
    """The key of a channel that there is; whether training can go through it, the engine says."""
    asked = words.channel(channel, "--channel")
    if asked.file is not None:
        raise DefinitionError("--channel: a recorded trace is for eval")
    return asked.key


def _check_said_once(overrides: Sequence[str], options: Mapping[str, object]) -> None:
    """Refuse an option beside a `--set` of the same setting: one of them would not count."""
    paths = ([part.strip() for part in text.partition("=")[0].split(".")] for text in overrides)
    said = {".".join(path[-2:]) for path in paths}  # variants.dcc.algorithm.rate is algorithm.rate
    for setting, value in options.items():
        if value is not None and setting in said:
            raise DefinitionError(
                f"--set {setting} has an option of its own here: give one of both"
            )


def _definition(
    env: str, algorithm: str, profile: str, rate: str | None, steps: int | None
) -> Definition:
    """The question behind `train`; raises DefinitionError for names and rates that cannot be."""
    scale = PROFILES[profile]
    if steps is not None:
        scale = replace(scale, training={"train_env_steps": steps})
    question = ad_hoc_definition(env, [algorithm], profile, scale)
    try:  # a mistyped name need not wait for torch
        check_algorithm(algorithm, completion.algorithms())
    except DefinitionError as error:
        raise DefinitionError(f"--algorithm: {error}") from error
    if rate is not None:
        _check_takes_rate(algorithm)
    return question


def _check_takes_rate(algorithm: str) -> None:
    """Refuse a rate for an algorithm whose name says which one it has, such as simple DCC."""
    from msgdrop_cli.commands.parts import early

    if (known := early.told()) is None:
        from msgdrop_cli.engine.offers import catalogue

        known = catalogue()
    named = known.algorithm(algorithm)
    if "rate" in named.overrides:
        alike = [
            name
            for name, other in known.algorithms.items()
            if other.learner == named.learner and "rate" not in other.overrides
        ]
        means = f"{algorithm} means rate {named.overrides['rate']:g}"
        raise DefinitionError(f"--rate: {means}; these take one: {', '.join(alike)}")
