"""`--set`: one setting of all variants, or of one of them, changed on the command line."""

import re
import shlex
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from msgdrop_cli.definition.catalogue import Catalogue
from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.definition.spec import NAME, RunSpec, Variant
from msgdrop_cli.definition.strict import Where, shown
from msgdrop_cli.errors import nearest

SECTIONS = ("algorithm", "environment", "training")
_EVERY, _ONE = "algorithm.gamma=0.9", "variants.NAME.algorithm.rate=0.3"
_BARE_WORD = re.compile(r"[A-Za-z][A-Za-z0-9._:,+-]*")
_KEY = re.compile(r"[A-Za-z0-9_-]+")
_MOST_NAMES = 4
"""More variants are not listed in one line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Override:
    """One `--set`, read."""

    variant: str | None
    """The only variant that is meant; None: all."""
    section: str
    key: str
    value: Any
    text: str
    """The value as it was typed."""
    source: str = "--set"
    """Who asks for it."""

    @property
    def where(self) -> Where:
        """The place of the section, for errors about it."""
        top = Where(self.source)
        place = top if self.variant is None else top.at("variants").at(self.variant)
        return place.at(self.section)

    @property
    def path(self) -> str:
        """`algorithm.rate`."""
        return f"{self.section}.{self.key}"


def parse_override(text: str, settings: Sequence[str] = ()) -> Override:
    """`algorithm.gamma=0.9`, or `variants.md-0.2.algorithm.rate=0.3` for one variant alone.

    Quotes around the variant's name are as good as none. settings: the paths that there are, for
    who leaves the first part out. Raises DefinitionError.
    """
    where = Where("--set")
    path, equals, value = text.partition("=")
    variant, keys = None, [key.strip() for key in path.split(".")]
    if keys[0] == "variants":
        # A section and its keys have no dots, a variant's name may: so it is what is left.
        variant, keys = ".".join(keys[1:-2]).strip("\"'"), keys[-2:]
    named = variant is None or NAME.fullmatch(variant)
    if meant := [each for each in settings if each.rpartition(".")[2] == path.strip()]:
        raise where.error(f"a setting begins with its section: {' or '.join(meant)}")
    if not equals or not named or len(keys) != 2 or not all(map(_KEY.fullmatch, keys)):
        raise where.error(f"expected a path and a value ({_EVERY}, {_ONE}), not {shown(text)}")
    section, key = keys
    place = where if variant is None else where.at("variants").at(variant)
    if section not in SECTIONS:
        known = nearest(section[:64], SECTIONS)
        begins = "begins with" if variant is None else "goes on with"
        raise place.at(section).error(
            f"a path {begins} algorithm, environment or training; {known}"
        )
    return Override(
        variant=variant,
        section=section,
        key=key,
        value=_literal(value.strip(), place.at(section).at(key)),
        text=value.strip(),
    )


def check_variants(overrides: Sequence[Override], variants: Sequence[str]) -> None:
    """Refuse (DefinitionError) an override of a variant that is not among those to be trained."""
    for each in overrides:
        if each.variant is not None and each.variant not in variants:
            hint = nearest(each.variant, variants)
            where = Where("--set").at("variants").at(each.variant)
            raise where.error(f"this profile has no such variant; {hint}")


def check_arms(
    overrides: Sequence[Override], variants: Mapping[str, Variant], catalogue: Catalogue
) -> None:
    """Refuse (DefinitionError) an override of all variants of what one of them sets itself.

    It would make another variant of it, or two variants one, under the names that they had. What
    the name of its algorithm fixes is set by a variant, too.
    """
    for each in overrides:
        if each.variant is not None:
            continue
        own = [name for name, arm in variants.items() if each.key in getattr(arm, each.section)]
        by_name = [
            name
            for name, arm in variants.items()
            if each.section == "algorithm" and each.key in catalogue.fixed(arm.algorithm["name"])
        ]
        setters = [name for name in variants if name in {*own, *by_name}]
        if setters:
            one = f"variants.{(own or by_name)[0]}.{each.path}={each.text}"
            raise each.where.at(each.key).error(f"{_set_by(setters)}: --set {shlex.quote(one)}")


def applied(overrides: Sequence[Override], variant: str) -> list[Override]:
    """The overrides of a variant in the order in which they lie: those of its own on top."""
    to_all = [each for each in overrides if each.variant is None]
    return to_all + [each for each in overrides if each.variant == variant]


def described(overrides: Sequence[Override], spec: RunSpec) -> tuple[str, ...]:
    """What a run's record says of them: path and final value. The cosmetic ones are left out.

    overrides: as they were `applied`, so that of two of one setting the last one counts.
    """
    table = spec_to_dict(spec, cosmetic=False)
    last = {each.path: each for each in overrides if each.key in table[each.section]}
    return tuple(
        f"{'' if each.variant is None else f'variants.{each.variant}.'}{path}"
        f"={table[each.section][each.key]}"
        for path, each in last.items()
    )


def _set_by(names: Sequence[str]) -> str:
    """Who sets it, for any number of names, and what to do about it."""
    if len(names) == 1:
        return f"variant {names[0]} sets this itself; to change it"
    first, last = names[:-1], names[-1]
    if len(names) > _MOST_NAMES:
        first, last = names[: _MOST_NAMES - 1], f"{len(names) - _MOST_NAMES + 1} more"
    return f"variants {', '.join(first)} and {last} set this themselves; to change one alone"


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
