"""A plan made of what stands in the sources, before torch is loaded: it tells what is mistyped.

Nothing is listed here a second time: names, settings, their types and their defaults are read from
the files of games, learners and channels. Values out of range are told by the Configs themselves,
which the plan that is carried out is made with.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import field, make_dataclass
from typing import Any, Literal

from msgdrop_cli.commands.parts import sources, vocabulary
from msgdrop_cli.commands.parts.vocabulary import Section
from msgdrop_cli.definition.catalogue import Catalogue, NamedAlgorithm, PaperSizes
from msgdrop_cli.definition.overrides import parse_override
from msgdrop_cli.definition.paper import paper_sizes, sizes_in, sizes_of
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.spec import FOREIGN, Claim, Definition, is_factory
from msgdrop_cli.definition.strict import Where, convert
from msgdrop_cli.errors import DefinitionError, Mistakes, nearest

_TYPES: Mapping[str, Any] = {
    **{each.__name__: each for each in (int, float, bool, str)},
    "tuple[int, int]": tuple[int, int],
}


def check_early(
    definition: Definition, profile: str, *, overrides: Sequence[str], readings: Sequence[str]
) -> None:
    """Refuse (DefinitionError) what the plan refuses: names, keys, types and choices, metrics.

    Says nothing where not everything can be told from files: that is said a second later.
    """
    games = definition.games(profile)
    known = told()
    if known is None or any(map(is_factory, games)):
        return
    mistakes = Mistakes()
    with mistakes:
        plan(definition, profile, known, overrides=overrides, readings=readings, seeds=(1,))
    measured = {
        name: vocabulary.metrics(sources.module(game.package, "rules"))
        for game in vocabulary.environments()
        for name in {*game.names}.intersection(games)
    }
    with mistakes:
        check_metrics(definition.file, definition.claims, measured)
    mistakes.tell()


def check_metrics(
    file: str, claims: Sequence[Claim], measured: Mapping[str, Collection[str]]
) -> None:
    """Refuse (DefinitionError) claims on metrics that their environments have not.

    measured: by environment. What a learning curve is drawn of depends on the learner; it is not
    checked.
    """
    mistakes = Mistakes()
    for claim in claims:
        metrics = measured.get(claim.environment)
        if metrics and claim.measure == "evaluation" and claim.metric not in metrics:
            hint = nearest(claim.metric, metrics)
            problem = f"{claim.environment} does not measure {claim.metric!r}; {hint}"
            mistakes.add(Where(file).at("claims").at("metric").error(problem))
    mistakes.tell()


def told() -> Catalogue | None:
    """Every environment, algorithm and channel as far as files tell it; None if not all do.

    Games of other people may be written in another way than ours, and a Config may take fields
    from another.
    """
    from msgdrop_envs.packages import theirs  # it loads no game

    learners, games = vocabulary.algorithms(), vocabulary.environments()
    if theirs() or not all(each.complete for each in (*learners, *games)):
        return None
    configs = {each.module: _config(each) for each in learners}
    environments: dict[str, Any] = {}
    for game in games:
        config = _config(game)
        environments |= {n.name: config(**_values(game.name, n.changes)) for n in game.named}
    sizes: dict[tuple[str, str], PaperSizes] = {}
    for each in learners:
        tree = sources.module(each.package, each.module).tree
        own = sources.tables(tree.body, "SIZES").items()
        by_both = {game: {each.module: tables} for game, tables in own}
        place = Where(f"{each.module}.py").at("SIZES")
        sizes |= sizes_of(by_both, place, {*environments, FOREIGN}, configs)
    for game in games:
        for file, text in sources.texts(game.package, "sizes.toml").items():
            sizes |= sizes_in(text.encode(), Where(str(file)), environments, configs)
    algorithms = {
        named.name: NamedAlgorithm(
            learner=each.module,
            config_class=configs[each.module],
            overrides=_values(each.name, named.changes),
        )
        for each in learners
        for named in each.named
    }
    return Catalogue(
        environments=environments,
        algorithms=algorithms,
        paper=sizes | paper_sizes(environments, configs),
        channels=vocabulary.kinds(),
        checks_values=False,
    )


def _config(section: Section) -> type[Any]:
    """A dataclass with the fields of a Config, their types and defaults, and none of its checks."""
    fields = []
    for each in section.settings:
        names = vocabulary.parts(each.key) if each.key in vocabulary.PARTS else each.choices
        hint = Literal[tuple(names)] if names else _TYPES.get(each.type, Any)
        default = _values(section.name, ((each.key, each.default),)).get(each.key)
        try:
            convert(default, hint, Where(section.module).at(each.key))
        except DefinitionError:  # it is written as something that has to be reckoned
            hint = Any
        fields.append((each.key, hint, field(default=default)))
    return make_dataclass("Config", fields, frozen=True, kw_only=True)


def _values(section: str, pairs: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """Settings and their values, of those that are written down as `--set` takes them."""
    found = {}
    for key, text in pairs:
        try:
            value = parse_override(f"{section}.{key}={text}").value
        except DefinitionError:
            continue
        found[key] = tuple(value) if isinstance(value, list) else value
    return found
