"""`train` and `config show` make a question of their options; its mistakes are the options'."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType

from msgdrop_cli.definition.plan import AD_HOC
from msgdrop_cli.errors import DefinitionError

_OPTIONS = MappingProxyType(
    {
        f"{AD_HOC}: environments": "--env",
        f"{AD_HOC}: variants": "--algorithm",
        f"{AD_HOC}: profiles": "--profile",
    }
)
"""The parts of a question that nobody has written down, and what they were typed as."""


@contextmanager
def as_typed(options: Mapping[str, str] = MappingProxyType({})) -> Iterator[None]:
    """A context whose DefinitionErrors begin with the option that was typed.

    options: other places than those of every such question, e.g. `--set: training.channel`, which
    an option of its own has set.
    """
    try:
        yield
    except DefinitionError as error:
        for place, option in {**_OPTIONS, **options}.items():
            if found := re.fullmatch(rf"{re.escape(place)}(?:\.[^:]*)?: (.*)", str(error)):
                raise DefinitionError(f"{option}: {found[1]}") from error
        raise
