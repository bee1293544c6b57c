"""What `msgdrop watch` shows: a frame of an episode beside what is to be said of it."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from msgdrop_cli.report.characters import Cell, Picture, Signs, side_of

if TYPE_CHECKING:
    from rich.text import Text

KEYS = (
    *("space pause", ". step", "+/- speed", "0-9 tab agent", "arrows link", "b break/mend"),
    *("a all links", "c channel", "r again", "n next game", "q quit"),
)
_TIED = "\0"
"""For a space at which no line is broken."""
_BESIDE = 25
"""Columns of what stands beside the picture, at least."""


@dataclass(slots=True)
class Watching:
    """What is shown beside a frame, and where the user points."""

    title: str
    agents: int = 0
    step: int = 0
    frames_per_s: int = 10
    is_paused: bool = False
    chosen: int | None = None
    """The agent whose links alone are shown; None: all."""
    pointed_at: tuple[int, int] | None = None
    hand: dict[tuple[int, int], bool] = field(default_factory=dict)
    """Links that the user has broken or mended."""
    lost: int = 0
    said: int = 0
    """Messages of all steps before this one."""
    outcome: str = ""
    """What came of it, once it is over."""


def watched(
    frame: Any, state: Watching, size: tuple[int, int], signs: Signs, keys: Sequence[str] = KEYS
) -> "Text":
    """Lines for a terminal of this size, columns and rows; frame: an `engine.episode.Frame`."""
    from rich.text import Text

    columns, rows = size
    below = [state.outcome] if state.outcome else []
    below = [
        *(line for text in below for line in textwrap.wrap(text, columns)),
        *textwrap.wrap("  ".join(key.replace(" ", _TIED) for key in keys), columns),
    ]
    below = below[: rows // 4]
    room = max(1, rows - 1 - 2 - len(below))
    wide = max(2, columns - _BESIDE - 4)
    picture = Picture(*side_of(wide, room, frame.cells), signs)
    picture.paint(frame, state.agents, state.chosen, state.pointed_at)
    beside = _beside(frame, state, signs)
    drawn = picture.lines()
    text = Text(no_wrap=True, overflow="crop", end="")
    text.append(state.title[:columns], "bold")
    for number in range(max(len(drawn), min(len(beside), room + 2))):
        line = drawn[number] if number < len(drawn) else [(" " * len(drawn[1]), "")]
        used = sum(len(letters) for letters, _ in line) + 2
        text.append("\n")
        for cell in (*line, ("  ", ""), *_cut(beside[number : number + 1], columns - used)):
            text.append(*cell)
    for words in below:
        text.append(f"\n{words.replace(_TIED, ' ')}", "dim" if _TIED in words else "")
    return text


def _cut(lines: Sequence[Sequence[Cell]], width: int) -> list[Cell]:
    cut = list[Cell]()
    for letters, style in lines[0] if lines else ():
        cut.append((letters[: max(0, width)], style))
        width -= len(letters)
    return cut


def _beside(frame: Any, state: Watching, signs: Signs) -> list[list[Cell]]:
    """Lines of what is to be said."""
    at = "ended" if state.outcome else "paused" if state.is_paused else None
    speed = at or f"{state.frames_per_s} a second"
    lines: list[list[Cell]] = [[(f"step {state.step}, {speed}", "")]]
    if not state.outcome:  # which has the last step's, too: the frame was before it
        lines += [[(f"{name.replace('_', ' ')} {value:,.6g}", "")] for name, value in frame.score]
    if not frame.links:
        return [*lines, [("nobody hears anybody", "dim")], *_legend(frame, state.agents)]
    said, lost = state.said + frame.said, state.lost + frame.lost
    broken = sum(not link.works for link in frame.links)
    red = "bold red" if frame.lost else ""
    lines += [
        [(f"lost {frame.lost} of {frame.said} messages", red)],
        [(f"in all {lost:,} of {said:,}", "")],
        [(f"{broken} of {len(frame.links)} links broken", "bold red" if broken else "")],
    ]
    return [
        *lines,
        *_matrix(frame, state, signs),
        *_pointed(frame, state),
        *_legend(frame, state.agents),
    ]


def _matrix(frame: Any, state: Watching, signs: Signs) -> list[list[Cell]]:
    """Every link where a row and a column of agents meet."""
    works = {link.pair: link.works for link in frame.links}
    width = len(str(state.agents - 1)) + 1
    rows: list[list[Cell]] = []
    for i in range(1, state.agents):
        row: list[Cell] = [(f"{i:>{width}}", "bold reverse" if i == state.chosen else "dim")]
        for j in range(i):
            arrives = works.get((j, i))
            sign = " " if arrives is None else signs.works if arrives else signs.broken
            style = "" if arrives else "bold red"
            row.append(
                (sign.rjust(width), f"{style} reverse" if (j, i) == state.pointed_at else style)
            )
        rows.append(row)
    names = "".join(f"{j:>{width}}" for j in range(state.agents - 1))
    return [*rows, [(" " * width + names, "dim")]]


def _pointed(frame: Any, state: Watching) -> list[list[Cell]]:
    """What the link is that the user points at."""
    [link] = [each for each in frame.links if each.pair == state.pointed_at] or [None]
    if link is None:
        return []
    by_hand = state.hand.get(link.pair)
    words = "works" if link.works else "broken"
    if by_hand is not None:
        refused = by_hand and not link.works
        words = (
            "cannot be mended here" if refused else f"{'mended' if by_hand else 'broken'} by you"
        )
    return [[(f"{link.first}-{link.second} {words}", "bold yellow")]]


def _legend(frame: Any, agents: int) -> list[list[Cell]]:
    kinds = {disc.kind: disc.colour for disc in frame.discs[agents:]}
    return [
        [
            (kind[:1].upper(), f"bold white on rgb({','.join(map(str, colour))})"),
            (f" {kind}", "dim"),
        ]
        for kind, colour in kinds.items()
    ]
