"""`msgdrop unstable-test`: the paper's test in the unstable environment (l. 519-541), and more."""

from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import completion, options, words
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.sweep import Sweep
from msgdrop_cli.errors import DefinitionError

app = typer.Typer()
_QUESTION = "broken-links"
_MATRIX = (
    *("loss:0.2", "loss:0.5", "half", "all", "tmc-heavy", "bursts:0.5,10", "one-way:0.5"),
    *("silent:1", "delay:1", "delay:5", "loss:0.5+hold:5", "constant", "shuffled", "own"),
)
"""What `--matrix` evaluates through: losses, broken links, bursts, lateness, and the controls."""
_EPISODES = 1_000
"""Where nobody says how many."""

_Episodes = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help="Episodes of each policy and channel, or of each link.",
        show_default="1,000; with --links 64",
        parser=options.whole,
    ),
]
_Workers = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help="Processes that work at the same time.",
        show_default="2; with --links one",
        parser=options.whole,
    ),
]
_Swept = Annotated[
    str | None,
    typer.Option(
        metavar="KIND:LOW..HIGH:POINTS",
        help="Every variant against one setting of a channel, e.g. loss:0..1:11.",
        autocompletion=completion.swept,
    ),
]
_Matrix = Annotated[
    bool, typer.Option("--matrix", help="Every variant through many channels, as a map.")
]
_Links = Annotated[
    bool, typer.Option("--links", help="What each single link is worth to each policy.")
]


@app.command(
    "unstable-test",
    epilog=options.examples("unstable-test", "unstable-test --sweep loss:0..1:11 --episodes 200"),
)
def unstable_test(
    results: options.Folder = Path("results"),
    channel: options.Channels = None,
    sweep: _Swept = None,
    matrix: _Matrix = False,
    links: _Links = False,
    episodes: _Episodes = None,
    workers: _Workers = None,
    device: options.Device = "cpu",
    json: options.Json = False,
) -> int:
    """Break none, half and all of the links, and compare; or whatever else can fail.

    RESULTS is a folder (default: results). Published policies are used if the folder holds no
    others. Episodes that your own runs have are not played again.
    """
    count = _EPISODES if episodes is None else episodes
    processes = options.WORKERS if workers is None else workers
    options.check_workers(processes)
    options.check_episodes(count)
    options.check_device_name(device)
    if (sweep is not None) + bool(channel or matrix) + links > 1:
        raise DefinitionError("expected one of --sweep, --links, and --channel with --matrix")
    if links:
        if workers is not None:
            raise DefinitionError("--workers: --links plays in one process; leave it out")
        from msgdrop_cli.commands.parts.show_links import show_links  # after the quick checks

        return show_links(results, episodes=episodes, device=device, as_json=json)
    if sweep is not None:
        swept = _swept(sweep)
        from msgdrop_cli.commands.parts.show_sweep import show_sweep  # after the quick checks

        return show_sweep(
            results, swept, episodes=count, workers=processes, device=device, as_json=json
        )
    asked = [words.channel(each, "--channel") for each in channel or ()]
    asked += map(Channel.read, _MATRIX if matrix else ())
    from msgdrop_cli.commands.parts.measure import measure

    question = load_definition(_QUESTION)
    return measure(
        results,
        channels=tuple(dict.fromkeys((NONE_BROKEN, *asked))) if asked else question.channels,
        episodes=count,
        workers=processes,
        device=device,
        as_json=json,
        question=question,
    )


def _swept(text: str) -> Sweep:
    """The channels of a range; DefinitionError, naming the option, where one cannot be."""
    swept = Sweep.read(text, "--sweep")
    try:
        words.check_kinds(swept.channels)
    except ValueError as error:
        raise DefinitionError(f"--sweep: {error}") from error
    return swept
