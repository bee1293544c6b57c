"""`msgdrop replay`: one episode of a trained policy, as a page or as a picture that moves."""

from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import console, options, words
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.files import write_bytes_atomic

app = typer.Typer()


@app.command(
    epilog=options.examples(
        "replay RUN --html episode.html --broken-links half",
        "replay RUN --gif episode.gif --seed 7",
    )
)
def replay(
    run: Annotated[
        Path, typer.Argument(metavar="RUN", help="The folder of a run.", parser=options.path)
    ],
    html: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a page with a slider.", parser=options.path),
    ] = None,
    gif: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a picture that moves.", parser=options.path),
    ] = None,
    broken_links: options.BrokenLinks = "none",
    channel: Annotated[
        str | None,
        typer.Option(metavar="KIND:SETTINGS", help="What else messages go through."),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(metavar="N", help="Not the run's own episode.", parser=options.whole),
    ] = None,
) -> int:
    """Show one episode of a trained policy.

    It is the first one of its evaluation, or that of another --seed; the same policy, seed and
    channel give the same episode. Links that lose a message are red.
    """
    through = _through(broken_links, channel)
    if html is None and gif is None:
        raise DefinitionError("replay: say what to write: --html FILE or --gif FILE")
    from msgdrop_cli.engine.episode import play_episode
    from msgdrop_cli.engine.policy import check_trained
    from msgdrop_cli.report.replay import moving_picture, page

    check_trained(run)
    episode = play_episode(run, channel=through, seed=seed)
    console.note(episode.outcome)
    for file, make in ((html, page), (gif, moving_picture)):
        if file is not None:
            write_bytes_atomic(file, make(episode))
            console.result(f"replay  {file}")
    return 0


def _through(broken_links: str, channel: str | None) -> Channel:
    """The one channel that is asked for, checked."""
    through = words.channel(broken_links, "--broken-links")
    if channel is not None:
        if through != NONE_BROKEN:
            raise DefinitionError("--channel and --broken-links: give one of both")
        through = words.channel(channel, "--channel")
    options.check_channels([through])
    return through
