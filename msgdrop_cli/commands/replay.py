"""`msgdrop replay`: one episode of a trained policy, as a page, a moving picture or a film."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import console, episode, options
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
    run: episode.Run,
    html: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a page with a slider.", parser=options.path),
    ] = None,
    gif: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a picture that moves.", parser=options.path),
    ] = None,
    mp4: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a film; needs ffmpeg.", parser=options.path),
    ] = None,
    broken_links: options.BrokenLinks = "none",
    channel: episode.Channel = None,
    seed: episode.Seed = None,
) -> int:
    """Show one episode of a trained policy.

    It is the first one of its evaluation, or that of another --seed; the same policy, seed and
    channel give the same episode. Links that lose a message are red.
    """
    episode.check_seed(seed)
    through = episode.asked_channel(broken_links, channel)
    files = [file for file in (html, gif, mp4) if file is not None]
    _check_files(files)
    from msgdrop_cli.engine.episode import play_episode
    from msgdrop_cli.engine.policy import check_trained
    from msgdrop_cli.report.replay import film, moving_picture, page

    check_trained(run)
    played = play_episode(run, channel=through, seed=seed)
    console.note(played.outcome)
    for file, make in ((html, page), (gif, moving_picture), (mp4, film)):
        if file is not None:
            write_bytes_atomic(file, make(played))
            console.result(f"replay  {file}")
    return 0


def _check_files(files: Sequence[Path]) -> None:
    """Refuse nothing at all, one file for two things, and what is there and is no file."""
    if not files:
        raise DefinitionError("replay: say what to write: --html FILE, --gif FILE or --mp4 FILE")
    for number, file in enumerate(files):
        if file.resolve() in [each.resolve() for each in files[:number]]:
            raise DefinitionError(f"{file}: would be written twice; name a file for each")
        if file.exists() and not file.is_file():
            raise DefinitionError(f"{file}: is there and is no file; name another")
