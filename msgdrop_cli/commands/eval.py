"""`msgdrop eval`: what the trained policies are worth, with broken links if asked."""

from pathlib import Path

import typer

from msgdrop_cli.commands.parts import options, words
from msgdrop_cli.definition.channel import NONE_BROKEN

app = typer.Typer()


@app.command(
    "eval",
    epilog=options.examples(
        "eval --broken-links half", "eval results/published --broken-links 30% --episodes 100"
    ),
)
def evaluate(
    results: options.Folder = Path("results"),
    broken_links: options.BrokenLinks = "none",
    channel: options.Channels = None,
    episodes: options.Episodes = 1_000,
    workers: options.Workers = options.WORKERS,
    device: options.Device = "cpu",
    json: options.Json = False,
) -> int:
    """Evaluate trained policies, with broken links or through other channels if asked.

    RESULTS is a folder (default: results). Published policies are used if the folder holds no
    others. Episodes that your own runs have are not played again.
    """
    options.check_workers(workers)
    options.check_episodes(episodes)
    options.check_device_name(device)
    asked = [words.channel(broken_links, "--broken-links")]
    asked += [words.channel(each, "--channel") for each in channel or ()]
    from msgdrop_cli.commands.parts.measure import measure  # after the quick checks

    return measure(
        results,
        channels=tuple(dict.fromkeys((NONE_BROKEN, *asked))),
        episodes=episodes,
        workers=workers,
        device=device,
        as_json=json,
    )
