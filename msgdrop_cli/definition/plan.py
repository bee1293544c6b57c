"""From a definition to the runs it asks for, every setting resolved and checked.

Precedence: the paper's settings < the named algorithm < profile < variant < `--set`.
"""

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from msgdrop_cli.definition.catalogue import Catalogue
from msgdrop_cli.definition.run_id import run_id
from msgdrop_cli.definition.spec import (
    NAME,
    Claim,
    Definition,
    PlannedRun,
    Profile,
    RunSpec,
    TrainingSpec,
    Variant,
)
from msgdrop_cli.definition.strict import Where, overlay, shallow, shown
from msgdrop_cli.errors import DefinitionError, nearest

_SECTIONS = ("algorithm", "environment", "training")
_BARE_WORD = re.compile(r"[A-Za-z][A-Za-z0-9._-]*")
_KEY = re.compile(r"[A-Za-z0-9_-]+")
_MOST_SEEDS = 1_000
_LARGEST_SEED = 2**31 - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Everything that one command trains and measures."""

    definition: Definition
    profile: str
    runs: tuple[PlannedRun, ...]
    """Environment by environment, variant by variant, seed by seed. Two may have one run id."""
    broken_links: tuple[float, ...]
    evaluation_episodes: int

    @property
    def claims(self) -> tuple[Claim, ...]:
        """The definition's claims that these runs and evaluations can judge."""
        arms = {(run.spec.environment, run.variant) for run in self.runs}
        return tuple(
            claim
            for claim in self.definition.claims
            if {(claim.environment, claim.better), (claim.environment, claim.worse)} <= arms
            and (claim.measure == "learning" or claim.broken_links in self.broken_links)
        )


def plan(
    definition: Definition,
    profile: str,
    catalogue: Catalogue,
    *,
    overrides: Sequence[str] = (),
    seeds: Sequence[int] | None = None,
) -> Plan:
    """The runs of one profile, with `--set` overrides and seeds that replace the profile's.

    Raises DefinitionError, in one line: unknown profile, environment, algorithm or key, a value
    of the wrong type or out of range, or a seed that is refused.
    """
    where = Where(definition.file)
    if profile not in definition.profiles:
        known = nearest(profile[:64], definition.profiles)
        raise where.error(f"no profile is called {profile[:64]!r}; {known}")
    chosen = definition.profiles[profile]
    if seeds is None:
        numbers = _checked_seeds(chosen.seeds, where.at("profiles").at(profile).at("seeds"))
    else:
        numbers = _checked_seeds(tuple(seeds), Where("--seeds"))
    resolver = _Resolver(definition, profile, catalogue, _parsed_overrides(overrides))
    runs = [
        resolver.run(environment, variant, seed)
        for environment in chosen.environments or definition.environments
        for variant in chosen.variants or definition.variants
        for seed in numbers
    ]
    return Plan(
        definition=definition,
        profile=profile,
        runs=tuple(runs),
        broken_links=chosen.broken_links or definition.broken_links,
        evaluation_episodes=chosen.evaluation_episodes,
    )


def ad_hoc_definition(
    environment: str, algorithms: Sequence[str], profile_name: str, profile: Profile
) -> Definition:
    """The definition behind `msgdrop train`: named algorithms side by side on one environment.

    Raises DefinitionError for a name that cannot be one or is listed twice; `plan` checks whether
    they exist.
    """
    where = Where("msgdrop train")
    for name in (environment, *algorithms):
        if not NAME.fullmatch(name):
            raise where.error(f"{shown(name)} is not a name")
    if not algorithms or len(set(algorithms)) < len(algorithms):
        raise where.error("expected at least one algorithm, each only once")
    return Definition(
        name="train",
        file=where.file,
        title=f"Training on {environment}",
        question="What does training give?",
        source="the command line",
        environments=(environment,),
        broken_links=(0.0,),
        variants={name: Variant(label=name, algorithm={"name": name}) for name in algorithms},
        profiles={profile_name: profile},
        claims=(),
    )


def parse_seeds(text: str) -> tuple[int, ...]:
    """The seeds that `--seeds` asks for: `3` means 1, 2 and 3; `1,5,9` exactly these; `7,` just 7.

    Raises DefinitionError for anything but different whole numbers from 1 to 2**31 - 1.
    """
    where = Where("--seeds")
    words = [word.strip() for word in text.removesuffix(",").split(",")]
    if not all(word.isascii() and word.isdigit() and len(word) <= 10 for word in words):
        raise where.error(f"expected a count (3) or a list of seeds (1,5,9), not {shown(text)}")
    numbers = tuple(int(word) for word in words)
    return _checked_seeds(numbers if "," in text else numbers[0], where)


def _checked_seeds(seeds: int | tuple[int, ...], where: Where) -> tuple[int, ...]:
    if isinstance(seeds, int):
        if not 1 <= seeds <= _MOST_SEEDS:
            raise where.error(f"expected 1 to {_MOST_SEEDS} seeds, not {shown(seeds)}")
        return tuple(range(1, seeds + 1))
    if not 1 <= len(seeds) <= _MOST_SEEDS or len(set(seeds)) < len(seeds):
        raise where.error(f"expected 1 to {_MOST_SEEDS} seeds, all different")
    for seed in seeds:
        if not 1 <= seed <= _LARGEST_SEED:
            raise where.error(f"a seed lies between 1 and {_LARGEST_SEED}, not {shown(seed)}")
    return seeds


@dataclass(frozen=True, slots=True)
class _Resolver:
    """Lays the tables of one profile over each other, for any of its variants."""

    definition: Definition
    profile: str
    catalogue: Catalogue
    overrides: tuple[tuple[str, dict[str, Any]], ...]

    def run(self, environment: str, variant: str, seed: int) -> PlannedRun:
        arm = self.definition.variants[variant]
        place = Where(self.definition.file).at("variants").at(variant).at("algorithm")
        try:
            paper = self.catalogue.environment(environment)
        except DefinitionError as error:
            raise Where(self.definition.file).at("environments").error(str(error)) from None
        try:
            named = self.catalogue.algorithm(arm.algorithm["name"])
        except DefinitionError as error:
            raise place.at("name").error(str(error)) from None
        pair = (environment, named.learner)
        papers = Where(f"paper settings of {environment}")
        algorithm = [
            (papers.at("algorithm"), self.catalogue.paper_algorithm.get(pair, {})),
            (Where(f"algorithm {arm.algorithm['name']}"), named.overrides),
        ]
        training = [(papers.at("training"), self.catalogue.paper_training.get(pair, {}))]
        spec = RunSpec(
            environment=environment,
            environment_config=self._resolved(
                type(paper), "environment", variant, [(papers, shallow(paper))]
            ),
            algorithm=named.learner,
            algorithm_config=self._resolved(named.config_class, "algorithm", variant, algorithm),
            training=self._resolved(TrainingSpec, "training", variant, training),
            seed=seed,
        )
        return PlannedRun(
            run_id=run_id(spec),
            variant=variant,
            label=arm.label,
            definition=self.definition.name,
            profile=self.profile,
            spec=spec,
        )

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
            *((Where("--set").at(section), t) for named, t in self.overrides if named == section),
        ]
        made = overlay(cls, layers)
        # Once more through the types: a default written 0 for a float gives the run id of 0.0.
        return overlay(cls, [(file, shallow(made))])


def _parsed_overrides(overrides: Sequence[str]) -> tuple[tuple[str, dict[str, Any]], ...]:
    """`algorithm.rate=0.3` as `("algorithm", {"rate": 0.3})`, in the order given."""
    return tuple(_parsed_override(text) for text in overrides)


def _parsed_override(text: str) -> tuple[str, dict[str, Any]]:
    where = Where("--set")
    path, equals, value = text.partition("=")
    keys = [key.strip() for key in path.split(".")]
    if not equals or not all(_KEY.fullmatch(key) for key in keys) or len(keys) != 2:
        raise where.error(f"expected a path and a value (algorithm.rate=0.3), not {shown(text)}")
    section, key = keys
    if section not in _SECTIONS:
        known = nearest(section[:64], _SECTIONS)
        raise where.at(section).error(
            f"a path begins with algorithm, environment or training; {known}"
        )
    return section, {key: _literal(value.strip(), where.at(section).at(key))}


def _literal(text: str, where: Where) -> Any:
    """A value in TOML's notation; a bare word is a text."""
    try:
        table = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        table = {}
    if set(table) == {"value"}:
        return table["value"]
    if _BARE_WORD.fullmatch(text):
        return text
    raise where.error(f"expected a value such as 3, 0.5, true, fgh or [64, 48], not {shown(text)}")
