"""The paper's sizes and lengths for each game and learner, read strictly from `paper.toml`."""

from collections.abc import Iterable, Mapping
from typing import Any

from msgdrop_cli.definition.catalogue import PaperSizes
from msgdrop_cli.definition.load import PAPER, shipped_file
from msgdrop_cli.definition.spec import TrainingSpec
from msgdrop_cli.definition.strict import Where, convert, parse, read_toml
from msgdrop_cli.errors import nearest


def paper_sizes(
    environments: Iterable[str], learners: Mapping[str, type[Any]], content: bytes | None = None
) -> dict[tuple[str, str], PaperSizes]:
    """(environment, learner) to what the paper has for the pair, in the types of the Configs.

    learners: name to Config. content: read instead of the file that is shipped.
    Raises DefinitionError, in one line: an environment, learner or field that does not exist, a
    value of the wrong type, a pair without both of its tables.
    """
    where = Where(PAPER)
    table = read_toml(shipped_file(PAPER) if content is None else content, where)
    hint = Mapping[str, Mapping[str, PaperSizes]]
    known, found = set(environments), {}
    for environment, of_learners in convert(table, hint, where).items():
        if environment not in known:
            raise where.at(environment).error(f"no environment; {nearest(environment, known)}")
        for learner, sizes in of_learners.items():
            place = where.at(environment).at(learner)
            if learner not in learners:
                raise place.error(f"no learner; {nearest(learner, learners)}")
            found[environment, learner] = PaperSizes(
                algorithm=parse(learners[learner], sizes.algorithm, place.at("algorithm")),
                training=parse(TrainingSpec, sizes.training, place.at("training")),
            )
    return found
