"""What the TAB key offers; loads nothing heavy, and says nothing where it knows nothing."""

import re
from contextlib import suppress
from pathlib import Path

import typer

from msgdrop_cli.commands.parts import vocabulary
from msgdrop_cli.definition.channel import NAMED
from msgdrop_cli.definition.load import list_askable, list_definitions, load_definition
from msgdrop_cli.definition.readings import readings_of
from msgdrop_cli.definition.spec import Definition
from msgdrop_cli.errors import DefinitionError

_POLICIES = ("runs/*/*/policy.safetensors", "published/*/*/*/policy.safetensors")
_RUNS = ("runs/*/*/run.json", "published/*/*/*/run.json")
_RUN = re.compile(r"(.+)-s\d+-([0-9a-f]{8})")
"""Where policies and records lie in a results folder: looked up at every TAB, so not everywhere."""


def environments() -> list[str]:
    """The names of `--env`."""
    return [name for each in vocabulary.environments() for name in each.names]


def algorithms() -> list[str]:
    """The names of `--algorithm`."""
    return [name for each in vocabulary.algorithms() for name in each.names]


def questions() -> list[str]:
    """What `ablate` takes."""
    return list_askable()


def variants(context: typer.Context) -> list[str]:
    """The variants of the question that stands on the line, or of all questions."""
    asked = _question(context)
    definitions = [_definition(name) for name in ([asked] if asked else list_definitions())]
    return list(dict.fromkeys(name for each in definitions if each for name in each.variants))


def profiles(context: typer.Context) -> list[str]:
    """The profiles of the question that stands on the line, or of all questions."""
    asked = _question(context)
    definitions = [_definition(name) for name in ([asked] if asked else list_definitions())]
    return list(dict.fromkeys(name for each in definitions if each for name in each.profiles))


def channels() -> list[str]:
    """The kinds of channels, by their files, and those with a name of their own."""
    return sorted([*vocabulary.channels(), *NAMED])


def swept() -> list[str]:
    """The kinds of channels that have a setting for `--sweep` to run over."""
    return [f"{kind}:" for kind in vocabulary.swept_channels()]


def sides(context: typer.Context, incomplete: str) -> list[str]:
    """What `diff` compares: variants that have runs, and once a letter is there, run ids, too."""
    root = Path(context.params.get("results") or "results")
    found = [_RUN.fullmatch(file.parent.name) for each in _RUNS for file in root.glob(each)]
    named = [each.groups() for each in found if each]
    ids = sorted({run_id for _, run_id in named}) if incomplete else []
    return [*sorted({variant for variant, _ in named}), *ids]


def readings(context: typer.Context) -> list[tuple[str, str]]:
    """The readings that the question on the line can be asked under, or all."""
    definition = _definition(_question(context))
    games = _games(context, definition) if definition else ()
    return [(name, each.says) for name, each in readings_of(games).items()]


def settings(context: typer.Context) -> list[tuple[str, str]]:
    """The paths of `--set`, for the algorithm and the environment that stand on the line."""
    given = context.params
    if definition := _definition(_question(context)):
        variants = definition.variants.values()
        game = _games(context, definition)[0]
        pairs = [(game, str(arm.algorithm["name"])) for arm in variants]
    else:
        pairs = [(given.get("env", ""), given.get("algorithm", ""))]
    sections = dict.fromkeys(each for pair in pairs for each in vocabulary.sections(*pair))
    found = {f"{each.name}.{s.key}=": s.meaning for each in sections for s in each.settings}
    return list(found.items())


def runs() -> list[str]:
    """The folders in `results` of runs that have a policy."""
    return sorted(str(file.parent) for each in _POLICIES for file in Path("results").glob(each))


def topics() -> list[str]:
    """What `explain` takes; shells part words at spaces."""
    from msgdrop_cli.commands.parts.topics import topics

    return list(dict.fromkeys(n.replace(" ", "-") for topic in topics() for n in topic.names))


def _question(context: typer.Context) -> str | None:
    """What stands as the last argument; behind an option without its value it is not parsed yet."""
    name = context.params.get("name")
    return str(name) if name else next(reversed(context.args), None)


def _games(context: typer.Context, definition: Definition) -> tuple[str, ...]:
    """Those of the profile on the line, or all of the question."""
    profile = str(context.params.get("profile"))
    return definition.games(profile) if profile in definition.profiles else definition.environments


def _definition(name: str | None) -> Definition | None:
    if name is not None:
        with suppress(DefinitionError):
            return load_definition(name)
    return None
