"""What can be planned: every environment and learner that stands in a file."""

from msgdrop_cli.algorithms.registry import learners
from msgdrop_cli.definition.catalogue import Catalogue, NamedAlgorithm
from msgdrop_cli.definition.paper import paper_sizes
from msgdrop_envs import registry


def catalogue() -> Catalogue:
    """All settings of the paper and all named algorithms, found by file."""
    modules, environments = learners(), registry.settings()
    return Catalogue(
        environments=environments,
        algorithms={
            known_as: NamedAlgorithm(learner=name, config_class=module.Config, overrides=overrides)
            for name, module in modules.items()
            for known_as, overrides in module.NAMED.items()
        },
        paper=paper_sizes(environments, {name: module.Config for name, module in modules.items()}),
    )
