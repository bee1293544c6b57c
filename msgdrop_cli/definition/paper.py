"""Sizes and lengths for games and learners, read strictly: those of `paper.toml`, and others."""

from collections.abc import Collection, Mapping
from typing import Any

from msgdrop_cli.definition.catalogue import PaperSizes
from msgdrop_cli.definition.shipped import PAPER, shipped_file
from msgdrop_cli.definition.spec import TrainingSpec
from msgdrop_cli.definition.strict import Where, convert, parse, read_toml
from msgdrop_cli.errors import nearest


def paper_sizes(
    environments: Collection[str], learners: Mapping[str, type[Any]]
) -> dict[tuple[str, str], PaperSizes]:
    """(environment, learner) to what the paper has for the pair; raises as `sizes_in` does."""
    return sizes_in(shipped_file(PAPER), Where(PAPER), environments, learners)


def sizes_in(
    content: bytes, where: Where, environments: Collection[str], learners: Mapping[str, type[Any]]
) -> dict[tuple[str, str], PaperSizes]:
    """(environment, learner) to what a file like `paper.toml` says; raises as `sizes_of` does."""
    return sizes_of(read_toml(content, where), where, environments, learners)


def sizes_of(
    tables: Any, where: Where, environments: Collection[str], learners: Mapping[str, type[Any]]
) -> dict[tuple[str, str], PaperSizes]:
    """(environment, learner) to what tables by both say, in the types of the Configs.

    learners: name to Config. Raises DefinitionError, in one line: an environment, learner or field
    that does not exist, a value of the wrong type, a pair without both of its tables.
    """
    hint, found = Mapping[str, Mapping[str, PaperSizes]], {}
    for environment, of_learners in convert(tables, hint, where).items():
        if environment not in environments:
            known = nearest(environment[:64], environments)
            raise where.at(environment).error(f"no environment; {known}")
        for learner, sizes in of_learners.items():
            place = where.at(environment).at(learner)
            if learner not in learners:
                raise place.error(f"no learner; {nearest(learner[:64], learners)}")
            found[environment, learner] = PaperSizes(
                algorithm=parse(learners[learner], sizes.algorithm, place.at("algorithm")),
                training=parse(TrainingSpec, sizes.training, place.at("training")),
            )
    return found
