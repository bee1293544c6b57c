"""Which claims of a question the runs of one of its profiles can judge."""

from collections.abc import Container

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.readings import apart
from msgdrop_cli.definition.spec import Claim, Definition, record_name
from msgdrop_cli.definition.strict import Where


def judged_by(
    definition: Definition, arms: Container[tuple[str, str]], channels: Container[Channel]
) -> tuple[Claim, ...]:
    """The claims about these arms, an environment and a variant each, and these evaluations."""
    return tuple(
        claim
        for claim in definition.claims
        if (claim.environment, claim.better) in arms
        and (claim.environment, claim.worse) in arms
        and (claim.measure == "learning" or claim.channel in channels)
    )


def judged_at(definition: Definition, called: str) -> tuple[Claim, ...]:
    """The claims that a profile can judge, whichever of its runs there are.

    called: as records call it, with the readings that it was asked under, which add no claim.
    Raises DefinitionError if the question has no such profile.
    """
    name, _ = apart(called, definition.profiles)
    if name not in definition.profiles:
        raise Where(definition.file).error(f"no profile is called {called!r}")
    profile = definition.profiles[name]
    arms = {
        (record_name(environment), variant)
        for environment in definition.games(name)
        for variant in profile.variants or definition.variants
    }
    return judged_by(definition, arms, profile.channels or definition.channels)
