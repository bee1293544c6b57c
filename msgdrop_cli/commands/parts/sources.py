"""Reads what stands in Python files without loading them: tables of names, fields, docstrings.

Help, the TAB key and `explain` must not wait for torch, which the files of games and learners load.
"""

import ast
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from importlib.util import find_spec
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

_SOURCE = re.compile(r" ?\((?:paper|ours|figure|not in|l\.|MADRL|MPE|OpenAI|PAPER)[^()]*\)")
"""Where a value comes from: for readers of the source, not for who wants to change it."""

_tree = lru_cache(maxsize=256)(ast.parse)
"""Of one text: a command asks several times what stands in the games' files."""


class Setting(NamedTuple):
    """A field of a dataclass."""

    key: str
    default: str
    """In the notation of `--set`; empty where there is none."""
    choices: tuple[str, ...]
    """The values of a `Literal`; none for any other type."""
    type: str
    """As it is annotated: `int`, `tuple[int, int]`."""
    said: str
    """Its docstring, in one line."""

    @property
    def meaning(self) -> str:
        """What is said of it, without where its value comes from."""
        return _SOURCE.sub("", self.said)

    @property
    def source(self) -> str:
        """Where its value comes from: lines of the paper, or ours; empty if it does not say."""
        return "; ".join(each.strip(" ()") for each in _SOURCE.findall(self.said))


class Module(NamedTuple):
    """A file of a package."""

    name: str
    tree: ast.Module

    @property
    def docstring(self) -> str:
        """What stands at its top."""
        return ast.get_docstring(self.tree) or ""


def modules(package: str, containing: str = "") -> list[Module]:
    """The parsed files of a package that contain a text, in alphabetical order.

    None where the package is no good: who asks for more than help is told what is wrong with it.
    """
    try:
        files = texts(package, "*.py").items()
        return [Module(path.stem, _tree(text)) for path, text in files if containing in text]
    except (SyntaxError, ValueError):
        return []


def module(package: str, name: str) -> Module:
    """One of them; an empty one where there is none."""
    try:
        [text] = texts(package, f"{name}.py").values()
        return Module(name, _tree(text))
    except (SyntaxError, ValueError):
        return Module(name, ast.Module([], []))


def texts(package: str, pattern: str) -> dict[Path, str]:
    """What the files of a package contain, in alphabetical order; nothing if it is no good."""
    try:
        found = find_spec(package)
        folders = (found.submodule_search_locations if found else None) or ()
        files = sorted(file for folder in folders for file in Path(folder).glob(pattern))
        return {file: file.read_text() for file in files if file.stem != "__init__"}
    except Exception:  # it may be other people's: anything
        return {}


def entries(body: list[ast.stmt], table: str) -> Mapping[str, ast.expr]:
    """What a dictionary that is written down in a module or a class has under its texts."""
    written = _written(body, table)
    return _by_text(written) if written else {}


def tables(body: list[ast.stmt], name: str) -> Any:
    """The value of a dictionary of plain values; nothing if it is not written down."""
    with suppress(ValueError):
        if written := _written(body, name):
            return ast.literal_eval(written)
    return {}


def defining(tree: ast.Module, name: str) -> ast.Module:
    """The module that a class comes from: this one, or the one it is imported from."""
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and name in [each.name for each in node.names]:
            package, _, file = str(node.module).rpartition(".")
            return module(package, file).tree
    return tree


def classes(tree: ast.Module) -> Iterator[ast.ClassDef]:
    """The classes of a module."""
    return (node for node in tree.body if isinstance(node, ast.ClassDef))


def class_docstring(tree: ast.Module, name: str) -> str:
    """What a class of a module says of itself."""
    found = (ast.get_docstring(each) for each in classes(tree) if each.name == name)
    return next(found, None) or ""


def settings(tree: ast.Module, name: str) -> Iterator[Setting]:
    """The fields of a dataclass, each with the docstring below it."""
    body = [each for found in classes(tree) if found.name == name for each in found.body]
    for field, below in zip_longest(body, body[1:]):
        said = below.value if isinstance(below, ast.Expr) else None
        if isinstance(field, ast.AnnAssign) and "ClassVar" not in ast.unparse(field.annotation):
            yield Setting(
                key=ast.unparse(field.target),
                default=_default(field.value) if field.value else "",
                choices=_choices(field.annotation),
                type=ast.unparse(field.annotation),
                said=" ".join(str(said.value).split()) if isinstance(said, ast.Constant) else "",
            )


def constant(tree: ast.Module, name: str, attribute: str) -> Any:
    """The value that a class of a module gives to an attribute; None if it is not written down."""
    body = [each for found in classes(tree) if found.name == name for each in found.body]
    for each in body:
        if isinstance(each, ast.AnnAssign) and ast.unparse(each.target) == attribute and each.value:
            with suppress(ValueError):
                return ast.literal_eval(each.value)
    return None


def arguments(call: ast.expr) -> tuple[tuple[str, str], ...]:
    """The keywords of `Config(agents=4)`, or the keys of `{"agents": 4}`, with their values."""
    pairs: Mapping[str, ast.expr] = {}
    if isinstance(call, ast.Call):
        pairs = {each.arg: each.value for each in call.keywords if each.arg}
    elif isinstance(call, ast.Dict):
        pairs = _by_text(call)
    return tuple((key, literal(value)) for key, value in pairs.items())


def literal(value: ast.expr) -> str:
    """A value of the source in the notation of `--set`; a name or a sum as it stands."""
    try:
        return notation(ast.literal_eval(value))
    except ValueError:
        return ast.unparse(value)


def notation(value: Any) -> str:
    """A value as `--set` takes it: `true`, `[64, 48]`, `message`, `0.0001`."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(notation, value))}]"
    return str(value)


def _written(body: list[ast.stmt], table: str) -> ast.Dict | None:
    for node in body:
        targets = [node.target] if isinstance(node, ast.AnnAssign) else getattr(node, "targets", [])
        value = getattr(node, "value", None)
        is_it = any(isinstance(each, ast.Name) and each.id == table for each in targets)
        if is_it and isinstance(value, ast.Dict):
            return value
    return None


def _by_text(table: ast.Dict) -> dict[str, ast.expr]:
    keys = (key.value if isinstance(key, ast.Constant) else None for key in table.keys)
    pairs = zip(keys, table.values, strict=True)
    return {key: value for key, value in pairs if isinstance(key, str)}


def _choices(annotation: ast.expr) -> tuple[str, ...]:
    if not isinstance(annotation, ast.Subscript) or ast.unparse(annotation.value) != "Literal":
        return ()
    inside = annotation.slice
    return tuple(map(literal, inside.elts if isinstance(inside, ast.Tuple) else [inside]))


def _default(value: ast.expr) -> str:
    """The default of a field, which may stand in a call `field(default=..., metadata=...)`."""
    if isinstance(value, ast.Call):
        value = next((each.value for each in value.keywords if each.arg == "default"), value)
    return literal(value)
