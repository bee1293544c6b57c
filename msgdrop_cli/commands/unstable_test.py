"""`msgdrop unstable-test`: the paper's test in the unstable environment (l. 519-541)."""

from pathlib import Path

import typer

from msgdrop_cli.commands.parts import options
from msgdrop_cli.definition.load import load_definition

app = typer.Typer()
_QUESTION = "broken-links"


@app.command(
    "unstable-test",
    epilog=options.examples("unstable-test", "unstable-test results/published --episodes 100"),
)
def unstable_test(
    results: options.Folder = Path("results"),
    episodes: options.Episodes = 1_000,
    workers: options.Workers = 2,
    device: options.Device = "cpu",
    json: options.Json = False,
) -> int:
    """Break none, half and all of the links, and compare.

    RESULTS is a folder (default: results). Published policies are used if the folder holds no
    others. Episodes that were played before are not played again.
    """
    options.check_workers(workers)
    options.check_episodes(episodes)
    options.check_device_name(device)
    from msgdrop_cli.commands.parts.measure import measure  # after the quick checks

    question = load_definition(_QUESTION)
    return measure(
        results,
        channels=question.channels,
        episodes=episodes,
        workers=workers,
        device=device,
        as_json=json,
        question=question,
    )
