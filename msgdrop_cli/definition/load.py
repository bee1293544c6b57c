"""Reads a definition from TOML: one that is shipped (by its name) or one of the user (by its path).

Which environments and algorithms exist is not known here; `plan` checks them.
"""

import itertools
import os
import stat
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from msgdrop_cli.definition.channel import NONE_BROKEN, Channel, check_each_once
from msgdrop_cli.definition.figures import all_figures, part_of
from msgdrop_cli.definition.seeds import checked_seeds
from msgdrop_cli.definition.shipped import shipped_questions
from msgdrop_cli.definition.spec import (
    MOST_IN_FAMILY,
    NAME,
    Claim,
    Definition,
    Profile,
    Registration,
    Variant,
    record_name,
)
from msgdrop_cli.definition.strict import Where, build, read_toml
from msgdrop_cli.errors import DefinitionError, Mistakes, nearest

_LARGEST_FILE = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class ClaimTable:
    """One sentence of the paper; lists stand for every combination of their entries."""

    says: str
    """The sentence, e.g. `"DCC-MD catches more than DCC when links break"`."""
    source: str
    """Where it stands, e.g. `"l. 528"`."""
    better: str | tuple[str, ...] = ()
    """The variant that wins, or several, each of which does, e.g. `["md-0.2"]`."""
    worse: str | tuple[str, ...] = ()
    """The variant that loses, or several, e.g. `"dcc"`."""
    order: str | None = field(default=None, metadata={"instead": True})
    """Instead of both a chain, each better than the next, e.g. `"fdc > md-0.2 > dcc"`."""
    environment: str | tuple[str, ...]
    """In which game, or in which ones, e.g. `"pursuit-n6"`."""
    metric: str
    """By which of the game's metrics, e.g. `"catches_per_500"`."""
    channel: Channel = field(default=NONE_BROKEN, metadata={"also": "broken_links"})
    """Through which of the channels; without it no link is broken, e.g. `"half"`."""
    measure: Literal["evaluation", "learning"] = "evaluation"
    """`learning`: by the mean of the whole training curve; `evaluation`, which it is without this
    key: by the evaluation after training, e.g. `"evaluation"`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class QuestionFile:
    """What stands in a definition's file. `msgdrop explain toml` shows all keys with their text.

    Each docstring, here and in the tables, ends with an example.
    """

    title: str
    """What tables and figures are headed by, e.g. `"A moderate rate"`."""
    question: str
    """What is asked, in one sentence, e.g. `"What does a rate of a fifth do?"`."""
    source: str
    """Who asks: a place in the paper, or you, e.g. `"ours"`."""
    environments: tuple[str, ...]
    """The games, by the names that `--env` takes, e.g. `["pursuit-n6"]`."""
    channels: tuple[Channel, ...] = field(default=(NONE_BROKEN,), metadata={"also": "broken_links"})
    """An evaluation after training through each: shares of broken links, or other kinds with their
    settings; without it no link is broken, e.g. `["none", "half", 1.0]`."""
    variants: Mapping[str, Variant]
    """What is compared, one table a variant, e.g. `[variants."md-0.2"]`."""
    profiles: Mapping[str, Profile]
    """Scales to choose from with `--profile`, one table each; quick is the one that is meant if
    none is named, e.g. `[profiles.quick]`."""
    claims: tuple[ClaimTable, ...] = ()
    """Sentences that get a verdict, one table each, e.g. `[[claims]]`."""
    registration: Registration | None = None
    """When the claims are looked at, and how sure a verdict must be, e.g. `[registration]`."""

    def __post_init__(self) -> None:
        check_each_once(self.channels)


def load_definition(name_or_path: str) -> Definition:
    """The definition that is shipped under this name, or that stands in this `.toml` file.

    A figure of the paper, `figure-3a`, is the part of a question that the figure shows.

    Raises DefinitionError: one line that names the file, the key and what was expected.
    """
    if name_or_path.endswith(".toml") or os.sep in name_or_path:
        content = _read(Path(name_or_path))
        return _parsed(Path(name_or_path).stem, name_or_path, content, shipped=False)
    if figure := (figures := all_figures()).get(name_or_path):
        return part_of(load_definition(figure.question), name_or_path, figure)
    shipped = shipped_questions()
    if name_or_path not in shipped:
        hint = nearest(name_or_path[:64], (*shipped, *figures))
        raise DefinitionError(f"no ablation is called {name_or_path[:64]!r}; {hint}")
    file = shipped[name_or_path]
    return _parsed(name_or_path, file.name, file.read_bytes(), shipped=True)


def list_definitions() -> list[str]:
    """The names of the questions that are shipped, in alphabetical order; without figures."""
    return sorted(shipped_questions())


def list_askable() -> list[str]:
    """The names of the questions that are shipped, then those of the paper's figures."""
    return [*list_definitions(), *all_figures()]


def _read(path: Path) -> bytes:
    where = Where(str(path))
    try:
        facts = path.stat()
        if not stat.S_ISREG(facts.st_mode):
            raise where.error("expected a TOML file, this is none")
        if facts.st_size > _LARGEST_FILE:
            raise where.error(f"expected at most {_LARGEST_FILE} bytes, not {facts.st_size}")
        return path.read_bytes()
    except OSError as error:
        raise where.error(f"cannot be read: {error.strerror}") from error
    except ValueError as error:  # a NUL in the path
        raise where.error(f"cannot be read: {error}") from error


def _parsed(name: str, file: str, content: bytes, *, shipped: bool) -> Definition:
    where = Where(file)
    _check_names([name], where)
    read = _with_traces(build(QuestionFile, read_toml(content, where), where), where)
    mistakes = Mistakes()
    with mistakes:
        _check(read, where)
    claims: list[Claim] = []
    for number, claim in enumerate(read.claims, start=1):
        with mistakes:
            claims += _claims(claim, read, where.at("claims").at(str(number)))
    registered = where.at("registration")
    if read.registration and (games := tuple(read.registration.seen_in)):
        with mistakes:
            _check_known(games, read.environments, registered.at("seen_in"))
    mistakes.tell()
    if read.registration:
        _check_registration(read.registration, claims, registered)
    return Definition(
        name=name,
        file=file,
        title=read.title,
        question=read.question,
        source=read.source,
        environments=read.environments,
        channels=read.channels,
        variants=read.variants,
        profiles=read.profiles,
        claims=tuple(claims),
        registration=read.registration,
        shipped=shipped,
    )


def _with_traces(read: QuestionFile, where: Where) -> QuestionFile:
    """The same with the traces that it names, whose paths begin where the question's file lies."""

    def located(channels: Iterable[Channel]) -> tuple[Channel, ...]:
        return tuple(channel.located(Path(where.file).parent) for channel in channels)

    try:
        return replace(
            read,
            channels=located(read.channels),
            profiles={
                name: replace(each, channels=located(each.channels)) if each.channels else each
                for name, each in read.profiles.items()
            },
            claims=tuple(replace(c, channel=located([c.channel])[0]) for c in read.claims),
        )
    except ValueError as error:
        raise where.error(str(error)) from error


def _check(read: QuestionFile, where: Where) -> None:
    """Refuse names that cannot name a folder and restrictions to what is not there."""
    mistakes = Mistakes()
    for key, names in (
        ("environments", tuple(map(record_name, read.environments))),
        ("variants", tuple(read.variants)),
        ("profiles", tuple(read.profiles)),
    ):
        with mistakes:
            if not names:
                raise where.at(key).error("expected at least one")
            _check_names(names, where.at(key))
    labelled: dict[str, str] = {}
    for name, variant in read.variants.items():
        if (other := labelled.setdefault(variant.label, name)) != name:
            place = where.at("variants").at(name).at("label")
            problem = f"{other!r} has it, too; tables and figures could not tell them apart"
            mistakes.add(place.error(problem))
    for name, profile in read.profiles.items():
        place = where.at("profiles").at(name)
        with mistakes:
            _check_known(profile.environments, read.environments, place.at("environments"))
        with mistakes:
            _check_known(profile.variants, read.variants, place.at("variants"))
        with mistakes:
            checked_seeds(profile.seeds, place.at("seeds"))
    mistakes.tell()


def _check_names(names: Iterable[str], where: Where) -> None:
    seen = set[str]()
    for name in names:
        if not NAME.fullmatch(name):
            rule = "1 to 64 letters, digits, dots, dashes and underscores"
            raise where.at(name).error(f"a name is {rule}, beginning with a letter or digit")
        if name in seen:
            raise where.at(name).error("is listed twice")
        seen.add(name)


def _check_known(names: tuple[str, ...] | None, known: Iterable[str], where: Where) -> None:
    if names is None:
        return
    if not names:
        raise where.error("expected at least one")
    for name in names:
        if name not in known:
            raise where.error(f"{name[:64]!r} is not in this file; {nearest(name[:64], known)}")
    _check_names(map(record_name, names), where)


def _claims(claim: ClaimTable, read: QuestionFile, where: Where) -> Iterable[Claim]:
    """Every ordering that one sentence of the paper contains."""
    orderings = _orderings(claim, read, where)
    environments = _listed(claim.environment)
    _check_known(environments, read.environments, where.at("environment"))
    _check_names([claim.metric], where.at("metric"))
    evaluated = {*read.channels}.union(*(p.channels or () for p in read.profiles.values()))
    if claim.channel not in evaluated:
        known = ", ".join(channel.short for channel in sorted(evaluated))
        raise where.error(f"no profile evaluates with {claim.channel.label}; evaluated: {known}")
    return [
        Claim(
            says=claim.says,
            source=claim.source,
            better=winner,
            worse=loser,
            environment=record_name(environment),
            metric=claim.metric,
            channel=claim.channel,
            measure=claim.measure,
        )
        for environment, (winner, loser) in itertools.product(environments, orderings)
    ]


def _orderings(claim: ClaimTable, read: QuestionFile, where: Where) -> list[tuple[str, str]]:
    """Better and worse, pair by pair: of every combination, or of neighbours in an order."""
    better, worse = _listed(claim.better), _listed(claim.worse)
    if claim.order is not None:
        names = tuple(name.strip() for name in claim.order.split(">"))
        if better or worse or len(names) < 2:
            raise where.error('expected better and worse, or order = "a > b > c"')
        _check_known(names, read.variants, where.at("order"))
        return [*itertools.pairwise(names)]
    _check_known(better, read.variants, where.at("better"))
    _check_known(worse, read.variants, where.at("worse"))
    if both := set(better) & set(worse):
        raise where.error(f"{min(both)!r} cannot be better than itself")
    return [*itertools.product(better, worse)]


def _check_registration(rule: Registration, claims: Sequence[Claim], where: Where) -> None:
    """Refuse margins of what no claim is about, and families that are too large to be tested."""
    metrics = {claim.metric for claim in claims}
    for metric in rule.margin:
        if metric not in metrics:
            known = nearest(metric[:64], metrics)
            raise where.at("margin").at(metric).error(f"no claim compares it; {known}")
    for (environment, measure), count in Counter(claim.family for claim in claims).items():
        if count > MOST_IN_FAMILY:
            place = f"{environment}, {'in' if measure == 'learning' else 'after'} training"
            raise where.error(
                f"{count} claims are of one family ({place}); at most {MOST_IN_FAMILY} can be"
                " judged together"
            )


def _listed(value: str | tuple[str, ...]) -> tuple[str, ...]:
    return (value,) if isinstance(value, str) else value
