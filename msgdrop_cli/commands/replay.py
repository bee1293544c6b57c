"""`msgdrop replay`: one episode of a trained policy, as a page, a moving picture or a film."""

from collections.abc import Mapping
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
    asked = {"--html": html, "--gif": gif, "--mp4": mp4}
    _check_files({option: file for option, file in asked.items() if file is not None})
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


def _check_files(files: Mapping[str, Path]) -> None:
    """Refuse nothing at all, one file for two things, and what is no file or cannot become one."""
    if not files:
        raise DefinitionError("replay: say what to write: --html FILE, --gif FILE or --mp4 FILE")
    taken = set[Path]()
    for option, file in files.items():
        if file.resolve() in taken:
            raise DefinitionError(f"{option}: {file}: would be written twice; name a file for each")
        if file.exists() and not file.is_file():
            raise DefinitionError(f"{option}: {file}: is there and is no file; name another")
        options.check_place(file, option, is_file=True)
        taken.add(file.resolve())
