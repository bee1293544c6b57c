"""What can be typed: names and settings, read from the sources without loading them.

`tests/test_vocabulary.py` holds all of it to what is found when the sources are loaded.
"""

import ast
from collections.abc import Iterator, Mapping
from dataclasses import fields, make_dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from msgdrop_cli.commands.parts import sources
from msgdrop_cli.commands.parts.sources import Module, Setting
from msgdrop_cli.definition import spec

PARTS = {
    "topology": "msgdrop_cli.messages.topologies",
    "encoder": "msgdrop_cli.messages.encoders",
}
"""Settings of learners that are the name of a file, and where these lie."""


class Named(NamedTuple):
    """What people call a learner or a game with some of its settings."""

    name: str
    changes: tuple[tuple[str, str], ...]
    """What the name means: settings and their values, where they are not the defaults."""


class Section(NamedTuple):
    """A learner or a game, or what all have in common: what people call it, and its settings."""

    name: str
    """What a path of `--set` begins with."""
    package: str
    """Where it stands."""
    module: str
    """The file there that holds its settings."""
    named: tuple[Named, ...]
    settings: tuple[Setting, ...]
    complete: bool = True
    """Whether they all stand there: its Config has no base class that has others."""

    @property
    def names(self) -> tuple[str, ...]:
        """What people call it."""
        return tuple(each.name for each in self.named)


def algorithms() -> list[Section]:
    """Every learner, in the order of their files; the names are those of `--algorithm`."""
    return list(_sections("algorithm", "msgdrop_cli.algorithms", "NAMED"))


def environments() -> list[Section]:
    """Every game, in the order of their files; the names are those of `--env`."""
    from msgdrop_envs.packages import packages  # it loads no game

    return [each for game in packages() for each in _sections("environment", game, "PAPER")]


def metrics(rules: Module) -> Mapping[str, ast.expr]:
    """The metrics of the game whose rules these are, and what makes each."""
    found = (sources.entries(each.body, "metrics") for each in sources.classes(rules.tree))
    return next((table for table in found if table), {})


def parts(setting: str) -> list[str]:
    """The files that one of `PARTS` can name."""
    return [each.name for each in sources.modules(PARTS[setting])]


def channels() -> list[str]:
    """The kinds of channels, whose names are those of their files, wherever these lie."""
    package = find_spec("msgdrop_cli.channels")
    folders = package.submodule_search_locations if package else None
    files = (file for folder in folders or () for file in Path(folder).glob("[a-z]*.py"))
    return sorted(file.stem.replace("_", "-") for file in files)


def swept_channels() -> list[str]:
    """Those that have settings, one of which may run over a range."""
    return sorted(kind for kind, cls in kinds().items() if fields(cls))


def kinds() -> dict[str, type[Any]]:
    """Every kind of channel: a dataclass with its settings and its example, and nothing it does."""
    found = {}
    for each in sources.modules("msgdrop_cli.channels"):
        made = each.name.title().replace("_", "")
        settings = [(setting.key, Any) for setting in sources.settings(each.tree, made)]
        example = {"example": sources.constant(each.tree, made, "example")}
        found[each.name.replace("_", "-")] = make_dataclass(made, settings, namespace=example)
    return found


def training() -> Section:
    """What every run has."""
    tree = ast.parse(Path(spec.__file__).read_text())
    settings = tuple(sources.settings(tree, "TrainingSpec"))
    return Section("training", "msgdrop_cli.definition", "spec", (), settings)


def foreign() -> Section:
    """What each game of other people has that a factory makes."""
    package = "msgdrop_envs.foreign"
    settings = tuple(sources.settings(sources.module(package, "config").tree, "Config"))
    return Section("environment", package, "config", (), settings)


def sections(environment: str = "", algorithm: str = "") -> list[Section]:
    """What `--set` takes, for these names or for all there are.

    environment: as `--env` takes it; what a factory makes has settings, too.
    """
    return [
        training(),
        *(each for each in algorithms() if algorithm in ("", *each.names)),
        *(each for each in environments() if environment in ("", *each.names)),
        *([foreign()] if spec.is_factory(environment) else ()),
    ]


def _sections(name: str, package: str, table: str) -> Iterator[Section]:
    """The modules of a package that have a table of names, which is how a registry finds them."""
    for module in sources.modules(package, f"\n{table}"):
        meanings = sources.entries(module.tree.body, table)
        named = [Named(known_as, sources.arguments(each)) for known_as, each in meanings.items()]
        if named:
            home = sources.defining(module.tree, "Config")
            settings = tuple(sources.settings(home, "Config"))
            complete = any(c.name == "Config" and not c.bases for c in sources.classes(home))
            yield Section(name, package, module.name, tuple(named), settings, complete)
