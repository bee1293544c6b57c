"""Plays the frames of an episode as fast as the user wants, and heeds keys in between."""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.report.characters import Signs
from msgdrop_cli.report.watch import Watching, watched

SPEEDS = (1, 2, 5, 10, 20, 50, 100)
"""Frames a second."""
_LOOK_AGAIN_S = 0.25
"""How soon a paused picture fits a terminal that was made larger or smaller."""
_LEAVES = {"c": "c", "r": "r", "n": "n", "q": "q", "\x1b": "q", "gone": "q"}


class Screen(Protocol):
    """What a `terminal.Terminal` is to a player."""

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""

    @property
    def signs(self) -> Signs:
        """What it can show."""

    def draw(self, shown: Any) -> None:
        """Show it."""

    def key(self, seconds: float) -> str | None:
        """The next key, None if there is none so soon."""


class Left(Exception):
    """The user wants something else than this episode."""

    def __init__(self, key: str) -> None:
        super().__init__(key)
        self.key = key
        """`q` nothing more, `r` it again, `n` another game, `c` another channel."""


class Player:
    """One episode on a screen; `show` is what `engine.episode.play_episode` calls."""

    def __init__(self, screen: Screen, state: Watching) -> None:
        """state: is changed here as the episode goes on."""
        self.state = state
        self._screen = screen
        self._steps_on = False
        self._frame: Any = None
        """The one that is shown."""

    def show(self, frame_with: Callable[[Mapping[Any, bool]], Any]) -> Mapping[Any, bool]:
        """Show a frame for its time, or until the user goes on; raises Left."""
        state = self.state
        if self._frame is not None:
            state.lost += self._frame.lost
            state.said += self._frame.said
        state.step += 1
        until = time.monotonic() + 1.0 / state.frames_per_s
        self._steps_on = False
        frame = self._draw(frame_with)
        while not self._steps_on:
            left = until - time.monotonic()
            if left <= 0 and not state.is_paused:
                break
            before = self._screen.size
            key = self._screen.key(_LOOK_AGAIN_S if state.is_paused else left)
            if key is not None:
                self._heed(key, frame)
            if key is not None or self._screen.size != before:
                frame = self._draw(frame_with)
        return dict(state.hand)

    def end(self, outcome: str) -> None:
        """Show what came of it until the user wants something else; raises Left."""
        self.state.outcome = outcome
        while True:
            self._draw(lambda hand: self._frame)
            key = self._screen.key(_LOOK_AGAIN_S)
            if key in _LEAVES:
                raise Left(_LEAVES[key])
            if key is not None:
                self._choose(key, self._frame)

    def _draw(self, frame_with: Callable[[Mapping[Any, bool]], Any]) -> Any:
        frame = self._frame = frame_with(self.state.hand)
        self.state.agents = sum(bool(disc.label) for disc in frame.discs)
        self._screen.draw(watched(frame, self.state, self._screen.size, self._screen.signs))
        return frame

    def _heed(self, key: str, frame: Any) -> None:
        """Do what a key says."""
        state = self.state
        if key in _LEAVES:
            raise Left(_LEAVES[key])
        if key == " ":
            state.is_paused = not state.is_paused
        elif key == ".":
            state.is_paused = self._steps_on = True
        elif key in "+=-":
            place = SPEEDS.index(state.frames_per_s) + (-1 if key == "-" else 1)
            state.frames_per_s = SPEEDS[min(max(place, 0), len(SPEEDS) - 1)]
        elif key == "b" and state.pointed_at is not None:
            self._change([link for link in frame.links if link.pair == state.pointed_at])
        elif key == "a":
            self._change(self._shown(frame))
        else:
            self._choose(key, frame)

    def _change(self, links: Sequence[Any]) -> None:
        """Break these links, or mend them if one is broken, or give them back to the channel."""
        hand = self.state.hand
        if changed := [link.pair for link in links if link.pair in hand]:
            for pair in changed:
                del hand[pair]
        else:
            works = all(link.works for link in links)
            hand.update({link.pair: not works for link in links})

    def _choose(self, key: str, frame: Any) -> None:
        """Point at an agent or a link."""
        state = self.state
        if key == "\t":
            following = -1 if state.chosen is None else state.chosen
            state.chosen = following + 1 if following + 1 < state.agents else None
        elif key.isdecimal() and int(key) < state.agents:
            state.chosen = None if int(key) == state.chosen else int(key)
        pairs = [link.pair for link in self._shown(frame)]
        if key in ("left", "up", "right", "down") and pairs:
            on = 1 if key in ("right", "down") else -1
            start = pairs.index(state.pointed_at) if state.pointed_at in pairs else (on < 0) - 1
            state.pointed_at = pairs[(start + on) % len(pairs)]
        elif state.pointed_at not in pairs:
            state.pointed_at = None

    def _shown(self, frame: Any) -> list[Any]:
        """The links of the chosen agent, or all of them."""
        chosen = self.state.chosen
        return [link for link in frame.links if chosen is None or chosen in link.pair]


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
