"""`msgdrop train`: one named algorithm on one environment, outside any question."""

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import typer

from msgdrop_cli.commands import options
from msgdrop_cli.definition.plan import ad_hoc_definition
from msgdrop_cli.definition.spec import Profile
from msgdrop_cli.errors import DefinitionError, nearest

app = typer.Typer()

_PROFILES: Mapping[str, Profile] = MappingProxyType(
    {
        "quick": Profile(
            seeds=1,
            evaluation_episodes=200,
            training={"train_env_steps": 100_000},
            algorithm={"epsilon_anneal_env_steps": 50_000},
        ),
        "million": Profile(
            seeds=1,
            training={"train_env_steps": 1_000_000},
            algorithm={"epsilon_anneal_env_steps": 500_000},
        ),
        "paper": Profile(seeds=1),
    }
)
"""The scales of the shipped questions, with one seed."""


@app.command()
def train(
    env: Annotated[str, typer.Option(metavar="NAME", help="The environment.")] = "pursuit-n6",
    algorithm: Annotated[str, typer.Option(metavar="NAME", help="The algorithm.")] = "dcc-md",
    profile: options.Profile = "quick",
    overrides: options.Set = None,
    seeds: options.Seeds = None,
    workers: options.Workers = 2,
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
        seeds=seeds,
        workers=workers,
        device=device,
        results=results,
        dry_run=dry_run,
        json=json,
    )
    if profile not in _PROFILES:
        known = nearest(profile[:64], _PROFILES)
        raise DefinitionError(f"no profile is called {profile[:64]!r}; {known}")
    definition = ad_hoc_definition(env, [algorithm], profile, _PROFILES[profile])
    definition = replace(definition, profiles={profile: _fitting(_PROFILES[profile], algorithm)})
    from msgdrop_cli.commands.training import carry_out  # after the quick checks

    return carry_out(definition, checked)


def _fitting(profile: Profile, algorithm: str) -> Profile:
    """The profile without settings that the learner does not have: MADDPG anneals no epsilon."""
    from msgdrop_cli.engine.catalogue import catalogue

    named = catalogue().algorithms.get(algorithm)
    if named is None:
        return profile  # `plan` says what is wrong
    known = {field.name for field in fields(named.config_class)}
    kept = {name: value for name, value in profile.algorithm.items() if name in known}
    return replace(profile, algorithm=kept)
