"""`msgdrop watch`: an episode of a trained policy in the terminal, with a hand in its links."""

from shlex import quote
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import console, episode, options, words
from msgdrop_cli.errors import DefinitionError

app = typer.Typer()

_CHANNELS = ("none", "half", "all", "loss:0.3", "bursts:0.2,4", "delay:2", "half+mean")
"""What the key `c` goes round, beginning with what was asked for."""


@app.command(
    epilog=options.examples("watch RUN --broken-links half", "watch RUN --seed 7 --speed 20")
)
def watch(
    run: episode.Run,
    broken_links: options.BrokenLinks = "none",
    channel: episode.Channel = None,
    seed: episode.Seed = None,
    speed: Annotated[
        int, typer.Option(metavar="N", help="Frames a second.", parser=options.whole)
    ] = 10,
) -> int:
    """Watch a trained policy play in the terminal; break and mend links by hand.

    The episode is the one that `replay` shows of the same seed and channel. Links that lose a
    message are red. The keys stand below the picture.
    """
    from msgdrop_cli.commands.parts import player, terminal  # not for every TAB

    episode.check_seed(seed)
    if speed not in player.SPEEDS:
        known = ", ".join(map(str, player.SPEEDS))
        raise DefinitionError(f"--speed: expected one of {known}, not {speed}")
    first = episode.asked_channel(broken_links, channel)
    if not terminal.is_terminal():
        hint = f"msgdrop replay {quote(str(run))} --html episode.html"
        raise DefinitionError(f"watch needs a terminal that it can draw on; without one: {hint}")
    others = [words.channel(each, "--channel") for each in _CHANNELS]
    from msgdrop_cli.engine.policy import check_trained
    from msgdrop_cli.records.store import list_runs

    check_trained(run)
    own = list_runs(run)[0].seed if seed is None else seed
    with terminal.Terminal(console.second_screen()) as screen:
        player.play(screen, run, [first, *(each for each in others if each != first)], own, speed)
    return 0
