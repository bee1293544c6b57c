"""Which episode `replay` and `watch` show: the options that they share."""

from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import completion, options, words
from msgdrop_cli.definition.channel import NONE_BROKEN
from msgdrop_cli.definition.channel import Channel as AChannel
from msgdrop_cli.errors import DefinitionError

Run = Annotated[
    Path,
    typer.Argument(
        metavar="RUN",
        help="The folder of a run.",
        parser=options.path,
        autocompletion=completion.runs,
    ),
]
Channel = Annotated[
    str | None,
    typer.Option(
        metavar="KIND:SETTINGS",
        help="What else messages go through.",
        autocompletion=completion.channels,
    ),
]
Seed = Annotated[
    int | None,
    typer.Option(metavar="N", help="Not the run's own episode.", parser=options.whole),
]


def asked_channel(broken_links: str, channel: str | None) -> AChannel:
    """The one channel that is asked for, checked."""
    through = words.channel(broken_links, "--broken-links")
    if channel is not None:
        if through != NONE_BROKEN:
            raise DefinitionError("--channel and --broken-links: give one of both")
        through = words.channel(channel, "--channel")
    return through


def check_seed(seed: int | None) -> None:
    """Refuse a seed that no run can have."""
    options.chosen_seeds(seed, None)
