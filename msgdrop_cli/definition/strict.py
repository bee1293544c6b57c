"""From tables to frozen dataclasses, with one clear line for whatever does not fit.

The casts are int to float and, as people write 1e6, a whole float to int; nothing else is.
"""

import math
import re
import tomllib
import types
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from functools import cache
from typing import (
    Any,
    ClassVar,
    Literal,
    Protocol,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from msgdrop_cli.errors import DefinitionError, Mistakes, nearest

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]{1,64}")
LARGEST_INT = 2**63 - 1
"""What TOML has room for."""
_hints = cache(get_type_hints)  # else a fifth of reading thousands of records
_NAMES: Mapping[Any, str] = types.MappingProxyType(
    {bool: "true or false", int: "a whole number", float: "a finite number", str: "a line of text"}
)


class _Dataclass(Protocol):
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


T = TypeVar("T", bound=_Dataclass)


@dataclass(frozen=True, slots=True)
class Where:
    """A place in a file (or on the command line), as error messages show it."""

    file: str
    keys: tuple[str, ...] = ()

    def at(self, key: str) -> "Where":
        """The place of `key` inside this one."""
        return Where(self.file, (*self.keys, key))

    def error(self, problem: str) -> DefinitionError:
        """The error of this place: exactly one line, whatever the file or the problem contains."""
        return DefinitionError(one_line(f"{self}: {problem}"))

    def __str__(self) -> str:
        """`file.toml: variants."md-0.2".label`."""
        path = ".".join(_key(key) for key in self.keys)
        return f"{self.file}: {path}" if path else self.file


def read_toml(content: bytes, where: Where) -> dict[str, Any]:
    """The table that a TOML file contains; DefinitionError for what is not TOML in UTF-8."""
    try:
        return tomllib.loads(content.decode("utf-8-sig"))  # Windows' editors write a mark
    except UnicodeDecodeError as error:
        raise where.error("is not in UTF-8; save it in that encoding") from error
    except (ValueError, RecursionError) as error:
        raise where.error(f"is not TOML: {error}") from error


def build(cls: type[T], table: Any, where: Where | str) -> T:
    """The frozen dataclass `cls` made from `table`, with its own defaults for what is left out.

    Raises DefinitionError: not a table, unknown key, wrong type, missing key, or a ValueError of
    `__post_init__`; the message says where, what was expected, and the nearest known name.
    """
    place = Where(where) if isinstance(where, str) else where
    return overlay(cls, [(place, table)])


def overlay(cls: type[T], layers: Sequence[tuple[Where, Any]]) -> T:
    """The dataclass `cls` made from tables laid over each other, the last one on top.

    A combination that `__post_init__` refuses is blamed on the layer that spoiled it: a later
    layer may still repair it. Raises DefinitionError, as `build` does.
    """
    values: dict[str, Any] = {}
    given = set[str]()
    mistakes = Mistakes()
    failure: list[DefinitionError] = []
    made: T | None = None
    for where, table in layers:
        with mistakes:
            values |= parse(cls, table, where)
        given.update(table if isinstance(table, Mapping) else ())
        if missing := [each.name for each in _required(cls) if given.isdisjoint(names_of(each))]:
            made, failure = None, [where.error(f"{name!r} is missing") for name in missing]
            continue
        try:
            made, failure = None if mistakes.found else cls(**values), []
        except (ValueError, ArithmeticError) as error:
            made, failure = None, failure or [where.error(str(error))]
    mistakes.add(*failure)
    mistakes.tell()
    if made is None:
        raise DefinitionError(f"nothing says how to make a {cls.__name__}")
    return made


def parse(cls: type[_Dataclass], table: Any, where: Where) -> dict[str, Any]:
    """The entries of `table`, checked and converted to the types of the fields of `cls`.

    Raises DefinitionError as `build` does, but asks for no completeness.
    """
    if not isinstance(table, Mapping):
        raise where.error(f"expected a table, not {shown(table)}")
    hints = _hints(cls)
    names = {name: each.name for each in fields(cls) if each.init for name in names_of(each)}
    values: dict[str, Any] = {}
    mistakes = Mistakes()
    for key, value in table.items():
        with mistakes:
            if key not in names:
                raise where.at(str(key)).error(f"unknown key; {nearest(str(key)[:64], names)}")
            if names[key] in values:
                both = " and ".join(known for known in names if names[known] == names[key])
                raise where.error(f"{both} are two words for one thing; keep one")
            values[names[key]] = convert(value, hints[names[key]], where.at(key))
    mistakes.tell()
    return values


def shallow(value: _Dataclass) -> dict[str, Any]:
    """The fields of a dataclass as a table, one level deep."""
    return {field.name: getattr(value, field.name) for field in fields(value) if field.init}


def names_of(field: Field[Any]) -> list[str]:
    """The keys that mean a field: its name, and the other one that its metadata may give it."""
    return [field.name, *([field.metadata["also"]] if "also" in field.metadata else [])]


def convert(value: Any, hint: Any, where: Where) -> Any:
    """`value` as the type `hint`; DefinitionError where it is something else.

    Knows bool, int, float, str, Any, Literal, Optional and other unions, tuples, string-keyed
    mappings, dataclasses, and classes that `read` one value (ValueError for what they are not).
    Any other annotation is a mistake of ours: TypeError.
    """
    origin, arguments = get_origin(hint), get_args(hint)
    if hint is Any or (arguments[1:] == (Any,) and isinstance(value, Mapping)):
        return value
    if hint in _NAMES:
        return _scalar(value, hint, where)
    if origin is Literal:
        return _choice(value, arguments, where)
    if origin in (Union, types.UnionType):
        return _union(value, hint, where)
    if origin is tuple:
        return _tuple(value, hint, where)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        if not isinstance(value, Mapping):
            raise _wrong(value, hint, where)
        return dict(_all((key, entry, arguments[1], where.at(key)) for key, entry in value.items()))
    if hasattr(hint, "read") and not isinstance(value, hint):
        try:
            return hint.read(value)
        except ValueError as error:
            raise where.error(str(error)) from None
    if isinstance(hint, type) and is_dataclass(hint):
        return value if isinstance(value, hint) else build(hint, value, where)
    raise TypeError(f"{where}: no reader for fields of type {hint}")


def one_line(text: str) -> str:
    """`text` without control characters and line breaks, fit for a terminal."""
    if not text.isprintable():
        text = "".join(c if c.isprintable() else " " for c in text)
    return " ".join(text.split())


def shown(value: Any) -> str:
    """A value from a file in at most 50 printable characters, for an error message."""
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list | tuple):
        return "a list"
    if value is None or isinstance(value, bool):
        return {None: "nothing", True: "true", False: "false"}[value]
    if isinstance(value, int) and abs(value) > LARGEST_INT:
        return "a number beyond 64 bits"
    text = repr(value) if isinstance(value, str | float) else str(value)
    return text if len(text) <= 50 else f"{text[:47]}..."


def without_fraction(value: int | float) -> int | float:
    """`1e6` as 1000000; what has a fraction or is not finite stays a float."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _scalar(value: Any, hint: Any, where: Where) -> Any:
    if hint is int and type(value) is float:
        value = without_fraction(value)
    if hint is float and type(value) is int and abs(value) <= LARGEST_INT:
        value = float(value)
    if type(value) is not hint or (hint is int and abs(value) > LARGEST_INT):
        raise _wrong(value, hint, where)
    if hint is float:
        if not math.isfinite(value):
            raise _wrong(value, hint, where)
        return value + 0.0  # -0.0 becomes 0.0: one number, one run id
    if hint is str:
        value = " ".join(value.split())
        if not value or not value.isprintable():
            raise _wrong(value, hint, where)
    return value


def _choice(value: Any, choices: tuple[Any, ...], where: Where) -> Any:
    if any(type(choice) is type(value) and choice == value for choice in choices):
        return value
    names = [str(choice) for choice in choices]
    hint = f"; {nearest(value[:64], names)}" if isinstance(value, str) else ""
    raise where.error(f"expected one of {', '.join(names)}, not {shown(value)}{hint}")


def _union(value: Any, hint: Any, where: Where) -> Any:
    members = [member for member in get_args(hint) if member is not type(None)]
    if value is None and len(members) < len(get_args(hint)):
        return None
    if len(members) == 1:
        return convert(value, members[0], where)
    for member in members:
        if isinstance(value, list) and get_origin(member) is tuple:
            return convert(value, member, where)  # or the entry that is wrong is named
        try:
            return convert(value, member, where)
        except DefinitionError:
            continue
    raise _wrong(value, hint, where)


def _tuple(value: Any, hint: Any, where: Where) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise _wrong(value, hint, where)
    items = get_args(hint)
    if items[-1] is Ellipsis:
        items = items[:1] * len(value)
    if len(items) != len(value):
        raise where.error(f"expected {len(items)} entries, not {len(value)}")
    pairs = enumerate(zip(value, items, strict=True), start=1)
    entries = ((number, entry, item, where.at(str(number))) for number, (entry, item) in pairs)
    return tuple(entry for _, entry in _all(entries))


def _all(entries: Iterable[tuple[Any, Any, Any, Where]]) -> list[tuple[Any, Any]]:
    """Keys and values, these as their types; all that are wrong are told together."""
    mistakes = Mistakes()
    found = []
    for key, value, hint, where in entries:
        with mistakes:
            found.append((key, convert(value, hint, where)))
    mistakes.tell()
    return found


def _wrong(value: Any, hint: Any, where: Where) -> DefinitionError:
    return where.error(f"expected {_described(hint)}, not {shown(value)}")


def _described(hint: Any) -> str:
    if hint in _NAMES:
        return _NAMES[hint]
    if get_origin(hint) in (Union, types.UnionType):
        members = [member for member in get_args(hint) if member is not type(None)]
        return " or ".join(_described(member) for member in members)
    if get_origin(hint) is tuple:
        return f"a list [{_described(get_args(hint)[0])}, ...]"
    return f"a {hint.__name__.lower()}" if hasattr(hint, "read") else "a table"


def _required(cls: type[_Dataclass]) -> list[Field[Any]]:
    return [
        field
        for field in fields(cls)
        if field.init and field.default is MISSING and field.default_factory is MISSING
    ]


def _key(text: str) -> str:
    if _BARE_KEY.fullmatch(text):
        return text
    short = text if len(text) <= 64 else f"{text[:61]}..."
    return f'"{short}"' if short.isprintable() else repr(short)
