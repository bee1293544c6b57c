"""`msgdrop eval`: what the trained policies are worth, with broken links if asked."""

from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.commands import options, words

app = typer.Typer()


@app.command(
    "eval",
    epilog=options.examples(
        "eval --broken-links half", "eval results/published --broken-links 30% --episodes 100"
    ),
)
def evaluate(
    results: options.Folder = Path("results"),
    broken_links: Annotated[
        str,
        typer.Option(
            metavar="SHARE",
            help="How many links are broken: none, half, all, 0.3 or 30%.",
            autocompletion=lambda: list(words.LINKS),
        ),
    ] = "none",
    episodes: options.Episodes = 1_000,
    workers: options.Workers = 2,
    device: options.Device = "cpu",
    json: options.Json = False,
) -> int:
    """Evaluate trained policies, with broken links if asked.

    RESULTS is a folder (default: results). Published policies are used if the folder holds no
    others. Episodes that were played before are not played again.
    """
    fraction = words.broken_links(broken_links)
    options.check_workers(workers)
    options.check_episodes(episodes)
    options.check_device_name(device)
    from msgdrop_cli.commands.measuring import measure  # after the quick checks

    return measure(
        results,
        broken_links=tuple(dict.fromkeys((0.0, fraction))),
        episodes=episodes,
        workers=workers,
        device=device,
        as_json=json,
    )
