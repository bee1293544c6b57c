"""From a definition to the runs it asks for, every setting resolved and checked.

Precedence: the paper's settings < the named algorithm < profile < variant < `--reading` < `--set`.
What a variant sets itself is overridden by its own name only:
`--set variants.md-0.2.algorithm.rate=0.3`. Where a profile says how long is trained and not how
long is explored, the latter follows (`_explored`).
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import product
from typing import Any

from msgdrop_cli.definition.catalogue import Catalogue
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel, build_channel
from msgdrop_cli.definition.judged import judged_by
from msgdrop_cli.definition.overrides import (
    Override,
    applied,
    check_arms,
    check_variants,
    described,
    parse_override,
)
from msgdrop_cli.definition.profiles import profile_called
from msgdrop_cli.definition.readings import about_explored, as_overrides, explored_in, under
from msgdrop_cli.definition.registration import registered_as
from msgdrop_cli.definition.run_id import run_id
from msgdrop_cli.definition.seeds import checked_seeds
from msgdrop_cli.definition.spec import (
    NAME,
    Claim,
    Definition,
    PlannedRun,
    Profile,
    RunSpec,
    TrainingSpec,
    Variant,
    is_factory,
    record_name,
)
from msgdrop_cli.definition.strict import Where, overlay, parse, shallow, shown
from msgdrop_cli.errors import DefinitionError, Mistakes

AD_HOC, AD_HOC_NAME = "msgdrop train", "train"
"""The file and the name of a question of which no file asks."""
EXPLORING = "epsilon_anneal_env_steps"
"""The field of a learner that explores less and less."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Everything that one command trains and measures."""

    definition: Definition
    profile: str
    """With the readings that it is asked under: `quick-capture-once`."""
    runs: tuple[PlannedRun, ...]
    """Environment by environment, variant by variant, seed by seed; no two are one."""
    channels: tuple[Channel, ...]
    evaluation_episodes: int

    @property
    def claims(self) -> tuple[Claim, ...]:
        """The definition's claims that these runs and evaluations can judge."""
        arms = {(run.spec.environment, run.variant) for run in self.runs}
        return judged_by(self.definition, arms, self.channels)


def plan(
    definition: Definition,
    profile: str,
    catalogue: Catalogue,
    *,
    overrides: Sequence[str] = (),
    readings: Sequence[str] = (),
    seeds: Sequence[int] | None = None,
) -> Plan:
    """The runs of one profile, with `--set` overrides and seeds that replace the profile's.

    readings: names of other readings of the paper that it is asked under (`readings.py`).

    Raises DefinitionError, a line each mistake: unknown profile, environment, algorithm, channel,
    reading or key, a value of the wrong type or out of range, a seed that is refused, an override
    of what a variant sets itself, or two variants that are one.
    """
    where = Where(definition.file)
    chosen = profile_called(definition, profile)
    if seeds is None:
        numbers = checked_seeds(chosen.seeds, where.at("profiles").at(profile).at("seeds"))
    else:
        numbers = checked_seeds(tuple(seeds), Where("--seeds"))
    arms = {name: definition.variants[name] for name in chosen.variants or definition.variants}
    environments = definition.games(profile)
    changes = tuple(parse_override(text, catalogue.settings()) for text in overrides)
    check_variants(changes, tuple(arms))
    changes = (*as_overrides(readings, environments), *changes)
    called = under(profile, readings)
    resolver = Resolver(definition, profile, called, catalogue, changes)
    runs, mistakes = [], Mistakes()
    for environment, variant, seed in product(environments, arms, numbers):
        with mistakes:
            runs.append(resolver.run(environment, variant, seed))
    mistakes.tell()
    if catalogue.checks_values:  # of good values only: to name another arm is no help with bad ones
        check_arms(changes, arms, catalogue)
        _check_distinct(runs, where.at("profiles").at(profile))
    channels = _checked_channels(definition, profile, catalogue)
    exploring = explored_in(channels, readings)
    return Plan(
        definition=about_explored(definition, readings) if exploring else definition,
        profile=called,
        runs=tuple(runs),
        channels=tuple(dict.fromkeys((*channels, *exploring))),
        evaluation_episodes=chosen.evaluation_episodes,
    )


def ad_hoc_definition(
    environment: str, algorithms: Sequence[str], profile_name: str, profile: Profile
) -> Definition:
    """The definition behind `msgdrop train`: named algorithms side by side on one environment.

    Raises DefinitionError for a name that cannot be one or is listed twice; `plan` checks whether
    they exist.
    """
    where = Where(AD_HOC)
    for key, names in (("environments", (record_name(environment),)), ("variants", algorithms)):
        for name in names:
            if not NAME.fullmatch(name):
                raise where.at(key).error(f"{shown(name)} is not a name")
    if not algorithms or len(set(algorithms)) < len(algorithms):
        raise where.at("variants").error("expected at least one algorithm, each only once")
    return Definition(
        name=AD_HOC_NAME,
        file=where.file,
        title=f"Training on {environment}",
        question="What does training give?",
        source="the command line",
        environments=(environment,),
        channels=(NONE_BROKEN,),
        variants={name: Variant(label=name, algorithm={"name": name}) for name in algorithms},
        profiles={profile_name: profile},
        claims=(),
    )


def _check_distinct(runs: Sequence[PlannedRun], where: Where) -> None:
    """Refuse (DefinitionError) two variants that are one run: they would be compared as two."""
    first: dict[str, PlannedRun] = {}
    for run in runs:
        other = first.setdefault(run.run_id, run)
        if other.variant != run.variant:
            because = "with this --set " if run.overrides != other.overrides else ""
            raise where.error(
                f"variants {other.variant} and {run.variant} are one run on"
                f" {run.spec.environment}: {because}all their settings are equal;"
                " change or leave out one"
            )


def _checked_channels(
    definition: Definition, profile: str, catalogue: Catalogue
) -> tuple[Channel, ...]:
    """The profile's channels, or else the definition's; each exists and takes its settings."""
    where, channels = Where(definition.file), definition.channels
    if own := definition.profiles[profile].channels:
        where, channels = where.at("profiles").at(profile), own
    for channel in channels:
        try:
            build_channel(channel, catalogue.channels)
        except ValueError as error:
            raise where.at("channels").error(str(error)) from None
    return channels


@dataclass(frozen=True, slots=True)
class Resolver:
    """Lays the tables of one profile over each other, for any of its variants."""

    definition: Definition
    profile: str
    called: str
    """The profile with its readings."""
    catalogue: Catalogue
    overrides: tuple[Override, ...]
    origins: dict[str, Where] = field(default_factory=dict)
    """Where each setting of the last run got its value, by path; none for a default."""

    def run(self, environment: str, variant: str, seed: int) -> PlannedRun:
        """The run of one variant with one seed; raises DefinitionError."""
        arm = self.definition.variants[variant]
        file, mistakes = Where(self.definition.file), Mistakes()
        with mistakes, _at(file.at("environments")):
            paper = self.catalogue.environment(environment)
        with mistakes, _at(file.at("variants").at(variant).at("algorithm").at("name")):
            named = self.catalogue.algorithm(arm.algorithm["name"])
        mistakes.tell()
        try:
            sizes = self.catalogue.sizes(environment, named.learner)
        except DefinitionError as error:
            raise DefinitionError(f"{environment}, {variant}: {error}") from None
        papers = _source_of(environment)
        algorithm = [
            (papers.at("algorithm"), sizes.algorithm),
            (Where(f"algorithm {arm.algorithm['name']}"), named.overrides),
        ]
        with mistakes:
            algorithm.append(self._explored(overlay(named.config_class, algorithm)))
        training = [(papers.at("training"), sizes.training)]
        game = [(papers, shallow(paper))]
        with mistakes:
            environment_config = self._resolved(type(paper), "environment", variant, game)
        with mistakes:
            config = self._resolved(named.config_class, "algorithm", variant, algorithm)
        with mistakes:
            trained = self._resolved(TrainingSpec, "training", variant, training)
        mistakes.tell()
        spec = RunSpec(
            environment=record_name(environment),
            environment_config=environment_config,
            algorithm=named.learner,
            algorithm_config=config,
            training=trained,
            seed=seed,
        )
        if spec.training.channel != NONE_BROKEN.key and self.catalogue.check_channel:
            place = self.origins["training.channel"].at("channel")
            self.catalogue.check_channel(spec, str(place))
        return PlannedRun(
            run_id=run_id(spec),
            variant=variant,
            label=arm.label,
            definition=self.definition.name,
            profile=self.called,
            spec=spec,
            overrides=described(applied(self.overrides, variant), spec),
            registration=registered_as(self.definition, spec.environment),
        )

    def _explored(self, paper: Any) -> tuple[Where, dict[str, int]]:
        """Half of the training that a profile sets explores, and never more than the paper's does.

        At the paper's pace a short run would be random play to its end. paper: the learner's
        Config at its scale; a learner without epsilon is left alone.
        """
        place = Where(self.definition.file).at("profiles").at(self.profile).at("training")
        scale = self.definition.profiles[self.profile].training
        steps = parse(TrainingSpec, scale, place).get("train_env_steps")
        if steps is None or not hasattr(paper, EXPLORING):
            return place, {}
        return place, {EXPLORING: steps // 2} if steps // 2 < getattr(paper, EXPLORING) else {}

    def _resolved(
        self, cls: type[Any], section: str, variant: str, paper: list[tuple[Where, Any]]
    ) -> Any:
        """The Config of one section: the paper's layers, then profile, variant and `--set`."""
        file, arm = Where(self.definition.file), self.definition.variants[variant]
        own = dict(getattr(arm, section))
        if section == "algorithm":
            del own["name"]
        scale = getattr(self.definition.profiles[self.profile], section)
        layers = [
            *paper,
            (file.at("profiles").at(self.profile).at(section), scale),
            (file.at("variants").at(variant).at(section), own),
            *(
                (each.where, {each.key: each.value})
                for each in applied(self.overrides, variant)
                if each.section == section
            ),
        ]
        made = overlay(cls, layers)
        self.origins.update({f"{section}.{key}": place for place, table in layers for key in table})
        # Once more through the types: a default written 0 for a float gives the run id of 0.0.
        return overlay(cls, [(file, shallow(made))])


@contextmanager
def _at(place: Where) -> Iterator[None]:
    """A context whose DefinitionErrors are told at a place."""
    try:
        yield
    except DefinitionError as error:
        raise place.error(str(error)) from None


def _source_of(environment: str) -> Where:
    """Where a learner's sizes in a game are from; of games of other people the paper knows none."""
    whose = "our sizes for" if is_factory(environment) else "paper settings of"
    return Where(f"{whose} {environment}")
