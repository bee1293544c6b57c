"""What `explain` knows of commands, and of the words that the program uses as if all knew them.

All of it stands on a page or at the top of a file; nothing stands here.
"""

import re
from collections.abc import Iterator

from msgdrop_cli.commands.parts import sources
from msgdrop_cli.commands.parts.topics.topic import Topic, sentence
from msgdrop_cli.definition.pages import VERDICTS, page

_COMMAND = re.compile(r"`msgdrop ([a-z-]+)[^`]*`: (.*)")
_WORD = re.compile(r"^\*\*([^*]+)\.\*\*\s+(.+?)(?=\n\n|\Z)", re.MULTILINE | re.DOTALL)
"""A paragraph that begins with the words it defines."""
_FILES = {
    "message-dropout": ("msgdrop_cli.ops", "message_dropout"),
    "checkpoint": ("msgdrop_cli.engine", "checkpoint"),
    "cohort": ("msgdrop_cli.definition", "cohorts"),
}
"""Words that a file's first line says the meaning of."""


def command_topics() -> Iterator[Topic]:
    """Each command, as its file begins."""
    for module in sources.modules("msgdrop_cli.commands"):
        if found := _COMMAND.match(_first_line(module)):
            yield Topic("command", (found[1],), f"msgdrop {found[1]} --help", sentence(found[2]))


def word_topics() -> Iterator[Topic]:
    """The words of the page of verdicts, and those of files."""
    for words, text in _WORD.findall(page(VERDICTS)):
        yield Topic("word", tuple(words.lower().split(", ")), VERDICTS, text)
    for word, file in _FILES.items():
        text = sentence(_first_line(sources.module(*file)))
        yield Topic("word", (word,), "what the program says", text)


def _first_line(module: sources.Module) -> str:
    return module.docstring.partition("\n")[0].removesuffix(".")
