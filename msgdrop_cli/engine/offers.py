"""What can be planned: every environment, learner and channel that stands in a file."""

from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

from msgdrop_cli.algorithms.discovery import learner_class, learners
from msgdrop_cli.channels import kinds
from msgdrop_cli.definition.catalogue import Catalogue, ForeignGames, NamedAlgorithm, PaperSizes
from msgdrop_cli.definition.paper import paper_sizes, sizes_in, sizes_of
from msgdrop_cli.definition.spec import FOREIGN, NAME, RunSpec
from msgdrop_cli.definition.strict import Where, convert
from msgdrop_cli.engine.lost_messages import training_kind
from msgdrop_cli.errors import DefinitionError
from msgdrop_envs import foreign, registry
from msgdrop_envs.foreign.config import Config
from msgdrop_envs.foreign.survey import survey

_SIZES = "learners.toml"
"""What learners begin with in games of other people."""


def catalogue() -> Catalogue:
    """All settings of the paper and all named algorithms, found by file.

    Of sizes the paper's count first, then a game's, then a learner's. Raises DefinitionError if a
    game that somebody else has installed cannot be used, or sizes cannot be read.
    """
    modules = learners()
    environments, files = _games()
    configs = {name: module.Config for name, module in modules.items()}
    sizes: dict[tuple[str, str], PaperSizes] = {}
    for name, module in modules.items():
        place = Where(f"{name}.py").at("SIZES")
        own = convert(getattr(module, "SIZES", {}), Mapping[str, Any], place)
        by_both = {game: {name: tables} for game, tables in own.items()}
        sizes |= sizes_of(by_both, place, {*environments, FOREIGN}, configs)
    theirs = (resources.files(foreign) / _SIZES).read_bytes()
    sizes |= sizes_in(theirs, Where(_SIZES), {FOREIGN}, configs)
    for file, content in files.items():
        sizes |= sizes_in(content, Where(file), environments, configs)
    return Catalogue(
        environments=environments,
        algorithms={
            known_as: NamedAlgorithm(learner=name, config_class=module.Config, overrides=overrides)
            for name, module in modules.items()
            for known_as, overrides in module.NAMED.items()
        },
        paper=sizes | paper_sizes(environments, configs),
        channels=kinds(),
        foreign=ForeignGames(config_class=Config, survey=cache(_surveyed)),
        check_channel=_check_channel,
    )


def _check_channel(run: RunSpec, said: str) -> None:
    """Refuse (DefinitionError, beginning with `said`) a channel that training cannot go through."""
    try:
        env = registry.make(run.environment_config, "meta")  # has shapes and takes no memory
    except (ArithmeticError, RuntimeError, TypeError, ValueError):
        return  # sizes beyond 64 bits are refused with those of everything else
    training_kind(run.training.channel, env, learner_class(run.algorithm), said)


def _surveyed(factory: str) -> Config:
    """The Config of what a factory makes, which the user has asked for."""
    try:
        return survey(factory)
    except registry.GameError as error:
        raise DefinitionError(str(error)) from error


def _games() -> tuple[dict[str, Any], dict[str, bytes]]:
    """The settings of all games, and the files of sizes that some bring along."""
    try:
        environments, files = registry.settings(), registry.size_files()
        for name, config in environments.items():
            if not NAME.fullmatch(name):
                raise registry.GameError(f"{type(config).__module__}: {name!r} is not a name")
    except registry.GameError as error:
        raise DefinitionError(f"{error}; mend or uninstall this package") from error
    return environments, files
