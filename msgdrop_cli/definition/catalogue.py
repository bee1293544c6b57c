"""What exists to choose from. The engine fills it, so that planning needs no torch."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, fields
from typing import Any

from msgdrop_cli.definition.spec import FOREIGN, RunSpec, TrainingSpec, is_factory
from msgdrop_cli.errors import DefinitionError, nearest


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedAlgorithm:
    """A name that people use for a learner with some of its settings, e.g. `dcc-md`."""

    learner: str
    """The file in `algorithms`, e.g. `dcc`."""
    config_class: type[Any]
    """The learner's frozen Config."""
    overrides: Mapping[str, Any]
    """What the name means: fields of the Config."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperSizes:
    """What the paper has for one game and one learner, from `paper.toml`."""

    algorithm: Mapping[str, Any]
    """Fields of the learner's Config."""
    training: Mapping[str, Any]
    """Fields of TrainingSpec."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignGames:
    """The games that people name by a factory."""

    config_class: type[Any]
    """The frozen Config of all of them; its field `factory` says which one it is."""
    survey: Callable[[str], Any]
    """`package.module:factory` to its Config; it runs other people's code."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Catalogue:
    """Every environment and algorithm, with the paper's settings, and every channel."""

    environments: Mapping[str, Any]
    """Name to frozen Config instance: the paper's setting."""
    algorithms: Mapping[str, NamedAlgorithm]
    paper: Mapping[tuple[str, str], PaperSizes]
    """By environment and learner."""
    channels: Mapping[str, type[Any]]
    """Kind to its dataclass, whose fields are the settings."""
    foreign: ForeignGames | None = None
    checks_values: bool = True
    """Whether its Configs refuse values out of range."""
    check_channel: Callable[[RunSpec, str], None] | None = None
    """DefinitionError, beginning with a place, for a run whose training its channel refuses."""

    def environment(self, name: str) -> Any:
        """The Config of the paper's setting `name`, or of what the factory `name` makes.

        Raises DefinitionError for an unknown one, or a factory that makes no usable game.
        """
        if is_factory(name) and self.foreign is not None:
            return self.foreign.survey(name)
        if name not in self.environments:
            known = nearest(name[:64], self.environments)
            theirs = "a PettingZoo game is named module:factory; other games come with a package"
            raise DefinitionError(f"no environment is called {name[:64]!r}; {known}; {theirs}")
        return self.environments[name]

    def environment_class(self, name: str, settings: Mapping[str, Any]) -> type[Any]:
        """The class of the Config that a record's environment has; nobody's code is run for it.

        Raises DefinitionError for an unknown one.
        """
        if self.foreign is not None and name not in self.environments and "factory" in settings:
            return self.foreign.config_class
        return type(self.environment(name))

    def algorithm(self, name: str) -> NamedAlgorithm:
        """The algorithm that people call `name`; DefinitionError for an unknown one."""
        check_algorithm(name, self.algorithms)
        return self.algorithms[name]

    def sizes(self, environment: str, learner: str) -> PaperSizes:
        """What the paper has for this pair; DefinitionError where nothing says it.

        A learner's defaults are the sizes of one game, which would fit others without a word.
        """
        environment = FOREIGN if is_factory(environment) else environment
        if (environment, learner) not in self.paper:
            fitting = [
                name
                for name, named in self.algorithms.items()
                if (environment, named.learner) in self.paper
            ]
            raise DefinitionError(
                f"no sizes are known of {learner} there: no [{environment}.{learner}] in paper.toml"
                f" or a sizes.toml of the game, no SIZES in {learner}.py;"
                f" what fits: {', '.join(fitting) or 'nothing yet'}"
            )
        return self.paper[environment, learner]

    def fixed(self, name: str) -> set[str]:
        """The fields of the Config that make an algorithm the one that people call `name`.

        Those that the name sets, and the choices (no numbers) in which it differs from another
        name of its learner: `dcc-md` with `dropout = "element"` would be `dcc-sd`, while the rate
        of `dcc-md` is free. Raises DefinitionError for an unknown one.
        """
        mine = self.algorithm(name)
        return set(mine.overrides) | {
            field
            for other in self.algorithms.values()
            if other.learner == mine.learner
            for field, value in other.overrides.items()
            if isinstance(value, str | bool)
        }

    def settings(self) -> list[str]:
        """The path of every setting, `algorithm.gamma`, in alphabetical order."""
        learners = {("algorithm", named.config_class) for named in self.algorithms.values()}
        games = {("environment", type(config)) for config in self.environments.values()}
        classes: set[tuple[str, type[Any]]] = {("training", TrainingSpec), *learners, *games}
        return sorted({f"{name}.{field.name}" for name, cls in classes for field in fields(cls)})

    def config_class(self, learner: str) -> type[Any]:
        """The Config of the learner's file `learner`; DefinitionError for an unknown one."""
        classes = {named.learner: named.config_class for named in self.algorithms.values()}
        if learner not in classes:
            known = nearest(learner[:64], classes)
            raise DefinitionError(f"no learner is called {learner[:64]!r}; {known}")
        return classes[learner]


def check_algorithm(name: str, known: Collection[str]) -> None:
    """Refuse (DefinitionError) a name that is none of these."""
    if name not in known:
        raise DefinitionError(f"no algorithm is called {name[:64]!r}; {nearest(name[:64], known)}")
