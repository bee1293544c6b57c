"""Other readings of the paper, by name: settings that any question can be asked under."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.overrides import SECTIONS, Override
from msgdrop_cli.definition.shipped import READINGS, shipped_file
from msgdrop_cli.definition.spec import NAME, Definition
from msgdrop_cli.definition.strict import Where, convert, read_toml, shown
from msgdrop_cli.errors import nearest

_OPTION = "--reading"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One statement of the paper, read in another way than by default."""

    says: str
    """The other way, in a line."""
    row: str
    """How the row of PAPER.md begins that it belongs to."""
    environments: tuple[str, ...]
    """Where it means something."""
    algorithm: Mapping[str, Any] = field(default_factory=dict)
    """Fields of the learner's Config."""
    training: Mapping[str, Any] = field(default_factory=dict)
    """Fields of TrainingSpec."""
    environment: Mapping[str, Any] = field(default_factory=dict)
    """Fields of the environment's Config."""
    evaluation_epsilon: float = 0.0
    """Evaluations are played at this epsilon, too, and claims are about these; no run changes."""


def all_readings() -> Mapping[str, Reading]:
    """Every reading by its name, in the order of `readings.toml`."""
    where = Where(READINGS)
    found: Mapping[str, Reading] = convert(
        read_toml(shipped_file(READINGS), where), Mapping[str, Reading], where
    )
    return found


def readings_of(environments: Sequence[str]) -> Mapping[str, Reading]:
    """The readings that mean something in all of these environments."""
    return {
        name: reading
        for name, reading in all_readings().items()
        if set(environments) <= set(reading.environments)
    }


def held_by(spec: Mapping[str, Any], environment: str) -> tuple[str, ...]:
    """The readings that the settings of a run have; spec: its tables by SECTIONS.

    Readings of evaluations are none of them: no run is another one under these.
    """
    return tuple(
        name
        for name, reading in readings_of([environment]).items()
        if not reading.evaluation_epsilon
        and all(
            spec.get(section, {}).get(key) == value
            for section in SECTIONS
            for key, value in getattr(reading, section).items()
        )
    )


def under(profile: str, readings: Sequence[str]) -> str:
    """What a profile is called under some readings: `quick-capture-once`.

    It is the word that runs, tables, figures and verdicts are told apart by; so readings that
    change no run do not stand in it.
    Raises DefinitionError where it gets too long for a name.
    """
    known = all_readings()
    telling = (name for name in readings if not known[name].evaluation_epsilon)
    called = "-".join((profile, *sorted(telling)))
    if readings and not NAME.fullmatch(called):
        raise Where(_OPTION).error(f"{shown(called)} is too long for a name; ask under fewer")
    return called


def apart(called: str, profiles: Iterable[str]) -> tuple[str, tuple[str, ...]]:
    """The profile and the readings that `under` made one word of.

    A word that begins with none of the profiles, or goes on with what is no reading, is a profile.
    """
    known = sorted(all_readings(), key=len, reverse=True)
    for profile in sorted(profiles, key=len, reverse=True):
        rest, readings = called.removeprefix(profile), []
        while fitting := [name for name in known if f"{rest}-".startswith(f"-{name}-")]:
            readings.append(fitting[0])
            rest = rest.removeprefix(f"-{fitting[0]}")
        if called.startswith(profile) and not rest:
            return profile, tuple(readings)
    return called, ()


def explored_in(channels: tuple[Channel, ...], readings: Sequence[str]) -> tuple[Channel, ...]:
    """The evaluations that readings ask for of policies that explore; none, as a rule.

    Each is named once, and one that asks for exploration by itself is left as it is.
    """
    epsilons = {all_readings()[name].evaluation_epsilon for name in readings} - {0.0}
    asked = [
        replace(channel, epsilon=channel.epsilon or epsilon)
        for epsilon in sorted(epsilons)
        for channel in channels
    ]
    return tuple(dict.fromkeys(asked))


def about_explored(definition: Definition, readings: Sequence[str]) -> Definition:
    """The same question, whose claims are about policies that explore when they are evaluated."""
    claims = (
        replace(claim, channel=explored_in((claim.channel,), readings)[0])
        for claim in definition.claims
    )
    return replace(definition, claims=tuple(claims))


def as_overrides(names: Sequence[str], environments: Sequence[str]) -> tuple[Override, ...]:
    """What readings set, of all variants.

    Raises DefinitionError: a name that there is not, is given twice or means nothing in one of
    the environments, or two readings of one setting.
    """
    known, where = all_readings(), Where(_OPTION)
    changes: dict[tuple[str, str], Override] = {}
    for number, name in enumerate(names):
        if name not in known:
            raise where.error(f"no reading is called {name[:64]!r}; {nearest(name[:64], known)}")
        if name in names[:number]:
            raise where.error(f"{name} is given twice")
        if strangers := set(environments) - set(known[name].environments):
            means = f"{name} means something in {', '.join(known[name].environments)}"
            raise where.error(f"{means}, not in {', '.join(sorted(strangers))}")
        for section in SECTIONS:
            for key, value in getattr(known[name], section).items():
                if other := changes.get((section, key)):
                    raise where.error(f"{name} and {other.source} are two readings of {key}")
                changes[section, key] = Override(
                    variant=None,
                    section=section,
                    key=key,
                    value=value,
                    text=json.dumps(value),  # which for these is TOML, too
                    source=f"{_OPTION} {name}",
                )
    return tuple(changes.values())
