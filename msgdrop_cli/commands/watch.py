"""`msgdrop watch`: an episode of a trained policy in the terminal, with a hand in its links."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import console, episode, options, terminal, words
from msgdrop_cli.commands.parts.player import SPEEDS, Left, Player, Screen
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.report.watch import Watching

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
    episode.check_seed(seed)
    if speed not in SPEEDS:
        known = ", ".join(map(str, SPEEDS))
        raise DefinitionError(f"--speed: expected one of {known}, not {speed}")
    first = episode.asked_channel(broken_links, channel)
    if not terminal.is_terminal():
        hint = f"msgdrop replay {run} --html episode.html"
        raise DefinitionError(f"watch needs a terminal that it can draw on; without one: {hint}")
    others = [words.channel(each, "--channel") for each in _CHANNELS]
    from msgdrop_cli.engine.policy import check_trained
    from msgdrop_cli.records.store import list_runs

    check_trained(run)
    own = list_runs(run)[0].seed if seed is None else seed
    with terminal.Terminal(console.second_screen()) as screen:
        play(screen, run, [first, *(each for each in others if each != first)], own, speed)
    return 0


def play(screen: Screen, run: Path, channels: Sequence[Channel], seed: int, speed: int) -> None:
    """Play an episode again, through the next channel, or that of the next seed, till it is left.

    channels: the first one is played first; speed: frames a second.
    """
    from msgdrop_cli.engine.episode import play_episode

    at = 0
    while True:
        title = f"{run.resolve().name}, {channels[at].label}, seed {seed}"
        player = Player(screen, Watching(title, frames_per_s=speed))
        try:
            found = play_episode(run, channel=channels[at], seed=seed, show=player.show)
            player.end(found.outcome)
        except Left as left:
            if left.key == "q":
                return
            at = (at + (left.key == "c")) % len(channels)
            seed += left.key == "n"
            speed = player.state.frames_per_s
