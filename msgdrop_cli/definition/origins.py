"""Where the settings of a planned run got their values: the last layer that names them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from msgdrop_cli.definition.catalogue import Catalogue
from msgdrop_cli.definition.overrides import parse_override
from msgdrop_cli.definition.plan import EXPLORING, Resolver
from msgdrop_cli.definition.readings import as_overrides
from msgdrop_cli.definition.spec import Definition, PlannedRun, RunSpec, record_name

DEFAULT = "default"
"""Of what no layer names."""


def origins(
    run: PlannedRun,
    definition: Definition,
    profile: str,
    catalogue: Catalogue,
    *,
    overrides: Sequence[str] = (),
    readings: Sequence[str] = (),
) -> Mapping[str, str]:
    """The place that each setting of a run comes from, by path; those at their default are missing.

    run: one of `plan`'s, from the same question, profile, overrides and readings.
    """
    changes = (
        *as_overrides(readings, definition.games(profile)),
        *(parse_override(text, catalogue.settings()) for text in overrides),
    )
    resolver = Resolver(definition, profile, run.profile, catalogue, changes)
    resolver.run(game_of(run, definition), run.variant, run.spec.seed)
    told = {path: str(where) for path, where in resolver.origins.items()}
    derived = f"algorithm.{EXPLORING}"
    if derived in told and resolver.origins[derived].keys[-1:] == ("training",):
        told[derived] = f"ours: half of {told[derived]}"
    return told


def papers_spec(
    run: PlannedRun, definition: Definition, profile: str, catalogue: Catalogue
) -> RunSpec:
    """The run as the paper's settings and its algorithm's name alone would have it."""
    arm = definition.variants[run.variant]
    bare = replace(
        definition,
        variants={
            run.variant: replace(
                arm, training={}, environment={}, algorithm={"name": arm.algorithm["name"]}
            )
        },
        profiles={
            profile: replace(
                definition.profiles[profile], training={}, environment={}, algorithm={}
            )
        },
    )
    resolver = Resolver(bare, profile, profile, catalogue, ())
    return resolver.run(game_of(run, definition), run.variant, run.spec.seed).spec


def game_of(run: PlannedRun, definition: Definition) -> str:
    """As the question calls it: a factory's name in records is another one."""
    [game] = {name for name in definition.environments if record_name(name) == run.spec.environment}
    return game
