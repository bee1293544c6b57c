"""Which algorithms can act in an environment, and which channels mean something; loads torch."""

from collections.abc import Mapping, Sequence
from typing import Any

from msgdrop_cli.commands.parts.shapes import on_no_device
from msgdrop_cli.definition.channel import Channel, only_links
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.errors import DefinitionError


def check_fits(runs: Sequence[PlannedRun]) -> None:
    """Refuse (DefinitionError) a learner that cannot act in its environment, naming who can."""
    checked = set[tuple[str, str]]()
    for run in runs:
        environment, learner = run.spec.environment, run.spec.algorithm
        if (environment, learner) in checked:
            continue
        checked.add((environment, learner))
        place = f"{environment}, {run.variant}"
        with on_no_device(place):
            why = _why_not(run.spec.environment_config, learner, run.spec.algorithm_config)
        if why:
            fitting = ", ".join(_fitting(run.spec.environment_config))
            raise DefinitionError(f"{place}: {why}; what fits: {fitting}")


def check_channels_fit(environments: Mapping[str, Any], channels: Sequence[Channel]) -> None:
    """Refuse (DefinitionError) a channel that asks for more than one of these games has.

    environments: their Configs by name.
    """
    if only_links(channels):
        return
    from msgdrop_cli.engine.scene import kind_in
    from msgdrop_envs import registry

    for name, config in environments.items():
        with on_no_device(name):
            env = registry.make(config, "meta")
        for channel in channels:
            kind_in(channel, env, f"{name}, channel {channel.key}")


def _why_not(environment: Any, learner: str, config: Any) -> str | None:
    """What a learner says against an environment, None if nothing."""
    from msgdrop_cli.algorithms.discovery import learner_class
    from msgdrop_envs import registry

    try:
        learner_class(learner)([config], registry.make(environment, "meta"), "meta")
    except DefinitionError as error:
        return str(error)
    return None


def _fitting(environment: Any) -> list[str]:
    """The names of all algorithms whose learner has nothing against an environment."""
    from msgdrop_cli.engine.offers import catalogue

    algorithms = catalogue().algorithms.items()
    classes = {named.learner: named.config_class for _, named in algorithms}
    with on_no_device("the list of algorithms"):
        fit = {name for name, cls in classes.items() if _why_not(environment, name, cls()) is None}
    return [name for name, named in algorithms if named.learner in fit]
