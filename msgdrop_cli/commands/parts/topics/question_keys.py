"""The keys of a question's file as the loader defines them, each with its docstring and example.

`tests/test_explain.py` holds them to what the loader takes.
"""

import ast
import re
import sys
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_type_hints

from msgdrop_cli.commands.parts import sources
from msgdrop_cli.definition.load import QuestionFile
from msgdrop_cli.definition.strict import names_of

_EXAMPLE = re.compile(r",? e\.g\. `(.*)`\.$")
_WIDTH = 80
_HEAD = (
    "# A question's file: save it as mine.toml, then  msgdrop ablate mine.toml",
    "# What stands behind a # may be left out; settings: msgdrop explain SETTING",
)


class Key(NamedTuple):
    """One key of the file."""

    names: tuple[str, ...]
    """Its words, any one of which will do."""
    table: str
    """The key of the table that it stands in; empty at the top."""
    meaning: str
    example: str
    """A value, or the head of a table."""
    is_table: bool
    needed: bool
    """Whether its table is no table without it."""
    advised: bool
    """Whether it may be left out, but its default is not what most begin with."""
    instead: bool
    """Whether it stands in place of others, never beside them."""

    @property
    def paths(self) -> tuple[str, ...]:
        """`title`, `profiles.seeds`."""
        return tuple(f"{self.table}.{name}".lstrip(".") for name in self.names)


def question_keys(cls: type[Any] = QuestionFile, table: str = "") -> Iterator[Key]:
    """Every key, in the order of a file: each table's own ones behind its head."""
    tree = ast.parse(Path(str(sys.modules[cls.__module__].__file__)).read_text())
    said = {each.key: each.said for each in sources.settings(tree, cls.__name__)}
    hints = get_type_hints(cls)
    tables = []
    for field in fields(cls):
        example = _EXAMPLE.search(said[field.name])
        inner = _table(hints[field.name])
        key = Key(
            names=tuple(names_of(field)),
            table=table,
            meaning=_EXAMPLE.sub(".", said[field.name]),
            example=example[1] if example else "",
            is_table=inner is not None,
            needed=field.default is MISSING and field.default_factory is MISSING,
            advised=field.metadata.get("advised", False),
            instead=field.metadata.get("instead", False),
        )
        if inner is None:
            yield key
        else:
            tables.append((key, inner))
    for key, inner in tables:
        yield key
        yield from question_keys(inner, key.names[0])


def question_file(keys: Sequence[Key]) -> str:
    """A file that can be saved and asked: every key with its meaning and an example."""
    lines = [*_HEAD]
    needless = {key.names[0] for key in keys if key.is_table and not key.needed}
    for key in keys:
        stands = (key.needed or key.advised) and key.table not in needless
        mark = "" if stands else "# " if key.instead else "#"
        text = f"{key.names[0]} = {key.example}"
        lines += ["", *(f"# {line}" for line in textwrap.wrap(key.meaning, _WIDTH))]
        lines.append(mark + (key.example if key.is_table else text))
        lines += [f"# {other} is another word for {key.names[0]}" for other in key.names[1:]]
    return "\n".join(lines)


def _table(hint: Any) -> type[Any] | None:
    """The dataclass that a field's tables are made into; None for a field that is no table."""
    inner = (each for each in get_args(hint) if is_dataclass(each) and not hasattr(each, "read"))
    return next((each for each in inner if isinstance(each, type)), None)
