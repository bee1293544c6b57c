"""What can be planned: every environment and learner that stands in a file."""

from collections.abc import Mapping
from typing import Any

from msgdrop_cli.algorithms.registry import learners
from msgdrop_cli.definition.catalogue import Catalogue, NamedAlgorithm
from msgdrop_envs import registry


def catalogue() -> Catalogue:
    """All settings of the paper and all named algorithms, found by file."""
    algorithms: dict[str, NamedAlgorithm] = {}
    settings: dict[tuple[str, str], Mapping[str, Any]] = {}
    lengths: dict[tuple[str, str], Mapping[str, Any]] = {}
    for name, module in learners().items():
        for known_as, overrides in module.NAMED.items():
            algorithms[known_as] = NamedAlgorithm(
                learner=name, config_class=module.Config, overrides=overrides
            )
        for environment in module.PAPER:
            settings[environment, name] = module.PAPER[environment]
            lengths[environment, name] = module.TRAINING[environment]
    return Catalogue(
        environments=registry.settings(),
        algorithms=algorithms,
        paper_algorithm=settings,
        paper_training=lengths,
    )
