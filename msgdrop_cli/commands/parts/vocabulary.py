"""What can be typed: names and settings, read from the sources without loading them.

Help and the TAB key must not wait for torch, and what a setting means stands in the sources only.
`tests/test_vocabulary.py` holds all of it to what is found when the sources are loaded.
"""

import ast
import re
from collections.abc import Iterator
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from msgdrop_cli.definition import spec

_SOURCE = re.compile(r" ?\((?:paper|ours|figure|not in|l\.|MADRL|MPE|OpenAI|PAPER)[^()]*\)")
"""Where a value comes from: for readers of the source, not for who wants to change it."""


class Setting(NamedTuple):
    """A field of a Config."""

    key: str
    default: str
    """In the notation of `--set`."""
    meaning: str


class Section(NamedTuple):
    """A learner or a game, or what all have in common: what people call it, and its settings."""

    name: str
    """What a path of `--set` begins with."""
    names: tuple[str, ...]
    settings: tuple[Setting, ...]


def algorithms() -> list[Section]:
    """Every learner, in the order of their files; the names are those of `--algorithm`."""
    return list(_sections("algorithm", "msgdrop_cli.algorithms", "NAMED"))


def environments() -> list[Section]:
    """Every game, in the order of their files; the names are those of `--env`."""
    from msgdrop_envs.packages import packages  # it loads no game

    return [each for game in packages() for each in _sections("environment", game, "PAPER")]


def channels() -> list[str]:
    """The kinds of channels, whose names are those of their files."""
    files = (Path(spec.__file__).parents[1] / "channels").glob("[a-z]*.py")
    return sorted(file.stem.replace("_", "-") for file in files)


def training() -> tuple[Setting, ...]:
    """What every run has."""
    return tuple(_settings(ast.parse(Path(spec.__file__).read_text()), "TrainingSpec"))


def sections(environment: str = "", algorithm: str = "") -> list[Section]:
    """What `--set` takes, for these names or for all there are."""
    return [
        Section("training", (), training()),
        *(each for each in algorithms() if algorithm in ("", *each.names)),
        *(each for each in environments() if environment in ("", *each.names)),
    ]


def notation(value: Any) -> str:
    """A value as `--set` takes it: `true`, `[64, 48]`, `message`, `0.0001`."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(notation, value))}]"
    return str(value)


def _sections(name: str, package: str, table: str) -> Iterator[Section]:
    """The modules of a package that have a table of names, which is how a registry finds them."""
    for tree in _modules(package, table):
        if known_as := _keys(tree, table):
            yield Section(name, known_as, tuple(_settings(tree, "Config")))


def _modules(package: str, table: str) -> Iterator[ast.Module]:
    """The parsed files of a package that may have a table; most files need no parsing.

    None where the package is no good: who asks for more than help is told what is wrong with it.
    """
    try:
        found = find_spec(package)
        folders = (found.submodule_search_locations if found else None) or ()
        for file in sorted(file for folder in folders for file in Path(folder).glob("*.py")):
            if f"\n{table}" in (text := file.read_text()):
                yield ast.parse(text)
    except Exception:  # it may be other people's: anything
        return


def _keys(tree: ast.Module, table: str) -> tuple[str, ...]:
    """The texts among the keys of a dictionary that a module writes down."""
    for node in tree.body:
        targets = [node.target] if isinstance(node, ast.AnnAssign) else getattr(node, "targets", [])
        value = getattr(node, "value", None)
        is_it = any(isinstance(each, ast.Name) and each.id == table for each in targets)
        if is_it and isinstance(value, ast.Dict):
            keys = (key.value for key in value.keys if isinstance(key, ast.Constant))
            return tuple(key for key in keys if isinstance(key, str))
    return ()


def _settings(tree: ast.Module, name: str) -> Iterator[Setting]:
    """The fields of a dataclass that have a default, each with the docstring below it."""
    configs = (node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == name)
    body = (each for config in configs for each in config.body)
    for field, below in pairwise(body):
        said = below.value if isinstance(below, ast.Expr) else None
        if isinstance(field, ast.AnnAssign) and field.value and isinstance(said, ast.Constant):
            meaning = _SOURCE.sub("", " ".join(str(said.value).split()))
            yield Setting(ast.unparse(field.target), _default(field.value), meaning)


def _default(value: ast.expr) -> str:
    """The default of a field, which may stand in a call `field(default=..., metadata=...)`."""
    if isinstance(value, ast.Call):
        value = next((each.value for each in value.keywords if each.arg == "default"), value)
    try:
        return notation(ast.literal_eval(value))
    except ValueError:  # a name or a sum, of some newcomer
        return ast.unparse(value)
