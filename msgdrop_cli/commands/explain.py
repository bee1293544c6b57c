"""`msgdrop explain`: what a name, a setting or a key means; loads nothing heavy."""

from collections.abc import Sequence
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import completion, console, options
from msgdrop_cli.commands.parts.topics import topics
from msgdrop_cli.commands.parts.topics.topic import Topic, spelled
from msgdrop_cli.errors import DefinitionError, near

app = typer.Typer()


@app.command(
    epilog=options.examples(
        "explain dcc-md",
        "explain under-specified",
        "explain toml   (a file to start a question from)",
    )
)
def explain(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]",
            help="One or more words that msgdrop uses: an algorithm, a game, a setting, a question,"
            " a figure, a reading, a verdict, a command; `toml` for all keys of a question's file;"
            " leave it out to list what there is.",
            autocompletion=completion.topics,
        ),
    ] = None,
    json: options.Json = False,
) -> int:
    """Say what a name means, with its settings, their defaults and the line of the paper."""
    known = topics()
    if not words:
        return _list(known, json)
    name = " ".join(words)
    found = [topic for topic in known if spelled(name) in map(spelled, topic.calls)]
    if not found:
        close = near(name.lower()[:64], [each for topic in known for each in topic.calls])
        meant = f"did you mean {' or '.join(map(repr, close))}?"
        hint = meant if close else "msgdrop explain lists what there is"
        raise DefinitionError(f"nothing is called {name[:64]!r}; {hint}")
    if json:
        console.result_json([_as_json(topic) for topic in found])
        return 0
    for number, topic in enumerate(found):
        if number:
            console.result("")
        _show(topic)
    return 0


def _show(topic: Topic) -> None:
    if topic.kind == "file":  # to be saved as it stands
        console.result(topic.text)
        return
    console.result(f"{' or '.join(topic.names)}: {topic.kind}, {topic.where}")
    if topic.text:
        console.result("")
        console.prose(topic.text)
    if topic.facts:
        console.result("")
        rows = {
            f"{each.name}={each.value}" if each.meaning else each.name: each.meaning or each.value
            for each in topic.facts
        }
        console.facts(rows, is_result=True)


def _list(known: Sequence[Topic], as_json: bool) -> int:
    kinds: dict[str, list[str]] = {}
    for topic in known:
        kinds.setdefault(topic.kind, []).extend(topic.names)
    names = {kind: list(dict.fromkeys(found)) for kind, found in kinds.items()}
    if as_json:
        console.result_json(names)
        return 0
    console.facts({kind: ", ".join(each) for kind, each in names.items()}, is_result=True)
    console.note("\nexplain one:  msgdrop explain NAME   (of a.b, b alone will do)")
    return 0


def _as_json(topic: Topic) -> dict[str, object]:
    return topic._asdict() | {"facts": [each._asdict() for each in topic.facts]}
