"""`msgdrop watch`: the episode that replay shows, in characters, with a hand in its links."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import torch

from msgdrop_cli.commands.parts.player import Left, Player, play
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.engine.episode import Frame, Link, by_hand, play_episode
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.messages.received import Received
from msgdrop_cli.report.characters import ASCII, UNICODE, Signs, side_of
from msgdrop_cli.report.watch import KEYS, Watching, watched
from msgdrop_envs.drawing import BLUE, ORANGE, Disc
from tests.cli_runs import msgdrop
from tests.pseudo_terminal import LEFT, at_a_terminal
from tests.runs import planned

HALF = Channel.read("half")
FRAME = Frame(
    [
        *(
            Disc(0.15, 0.15, 0.04, BLUE, "0", "pursuer"),
            Disc(0.85, 0.15, 0.04, BLUE, "1", "pursuer"),
        ),
        *(Disc(0.85, 0.85, 0.04, BLUE, "2", "pursuer"), Disc(0.5, 0.5, 0.03, ORANGE, "", "evader")),
    ],
    [Link(0, 1, True), Link(1, 2, False)],
    lost=2,
    said=4,
    score=(("return", -1.5), ("catches", 1.0)),
    cells=10,
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that was trained for a moment."""
    plan = planned("dcc-md", time_limit=25, train_env_steps=160)
    [outcome] = train_cohort([plan], tmp_path_factory.mktemp("results"))
    return outcome.path


class Script:
    """A screen whose keys are known beforehand."""

    def __init__(self, keys: str = "", size: tuple[int, int] = (80, 24)) -> None:
        self.keys, self.size, self.signs = list(keys), size, UNICODE
        self.drawn: list[str] = []

    def draw(self, shown: Any) -> None:
        """Keep it."""
        self.drawn.append(shown.plain)

    def key(self, seconds: float) -> str | None:
        """The next one; `_` is nothing."""
        key = self.keys.pop(0) if self.keys else "q"
        return None if key == "_" else {"<": "left", ">": "right"}.get(key, key)


def seen(keys: str, frame: Frame = FRAME) -> tuple[Player, Script, Mapping[Any, bool]]:
    """One frame of a paused player, in which these keys are typed; it goes on with `.`."""
    screen = Script(f"{keys}.")
    player = Player(screen, Watching("a run", is_paused=True))
    return player, screen, player.show(lambda hand: frame)


def text(
    frame: Frame = FRAME, size: tuple[int, int] = (80, 24), signs: Signs = UNICODE, **state: Any
) -> str:
    """What a terminal of this size shows."""
    return watched(frame, Watching("a run", agents=3, **state), size, signs).plain


def test_it_is_the_episode_that_replay_shows(run: Path) -> None:
    """Frame by frame: the same policy, seed and channel, whoever looks on."""
    frames = list[Frame]()

    def show(frame_with: Any) -> Mapping[Any, bool]:
        frames.append(frame_with({}))
        return {}

    for channel in (NONE_BROKEN, HALF, Channel.read("delay:2")):
        frames.clear()
        found = play_episode(run, channel=channel, seed=3, show=show)
        assert frames == found.frames
        assert found == play_episode(run, channel=channel, seed=3)


def test_scores_add_up_to_the_outcome(run: Path) -> None:
    """What is shown before a step is what came of all before it."""
    found = play_episode(run, channel=NONE_BROKEN)
    returns = [dict(frame.score)["return"] for frame in found.frames]
    assert returns[0] == 0.0
    assert returns[1:] != returns[:-1]
    assert abs(returns[-1]) <= abs(float(found.outcome.split("return ")[1].split(",")[0]))


def test_links_broken_by_hand_are_silent(run: Path) -> None:
    """All of them broken by hand are the channel that breaks all, step by step."""
    pairs = {(i, j): False for j in range(6) for i in range(j)}
    by_me = play_episode(run, channel=NONE_BROKEN, show=lambda frame_with: pairs)
    by_channel = play_episode(run, channel=Channel.read("all"))
    assert by_me.frames == by_channel.frames
    mended = play_episode(
        run, channel=Channel.read("all"), show=lambda frame_with: dict.fromkeys(pairs, True)
    )
    assert mended.frames == play_episode(run, channel=NONE_BROKEN).frames


def test_a_hand_breaks_both_ways_and_no_other_link() -> None:
    """Of three agents; what a channel has altered is not mended."""
    heard = by_hand(None, {(0, 2): False}, 3)
    assert heard is not None
    assert heard.keep.tolist() == [[[[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]]]
    old = Received(torch.zeros(1, 1, 3, 2), torch.zeros(1, 1, 3, 2, 5))
    kept = by_hand(old, {(0, 2): True}, 3)
    assert kept is not None
    assert kept.keep.sum() == 0
    assert by_hand(old, {}, 3) is old


def test_keys_go_where_they_say(run: Path) -> None:
    """The next channel, the next seed, again, and the end."""
    screen = Script("___cnr____q")
    play(screen, run, [NONE_BROKEN, HALF], seed=1, speed=100)
    titles = list(dict.fromkeys(drawn.partition("\n")[0] for drawn in screen.drawn))
    name = run.resolve().name
    assert titles == [
        f"{name}, none of the links broken, seed 1",
        f"{name}, half of the links broken, seed 1",
        f"{name}, half of the links broken, seed 2",
    ]


def test_the_end_shows_what_came_of_it() -> None:
    """Until a key leaves it; the score before the last step does not stand beside it."""
    screen = Script(".x_r")
    player = Player(screen, Watching("a run"))
    player.show(lambda hand: FRAME)
    with pytest.raises(Left) as left:
        player.end("steps 10, catches 2")
    assert left.value.key == "r"
    assert "catches 1" in screen.drawn[0]
    assert "steps 10, catches 2" in screen.drawn[-1]
    assert "catches 1" not in screen.drawn[-1]


def test_lost_messages_are_counted_once() -> None:
    """Two of four in each of three steps, however often a step is drawn."""
    screen = Script("0 0.0.0.")
    player = Player(screen, Watching("a run", is_paused=True))
    for _ in range(3):
        player.show(lambda hand: FRAME)
    assert "in all 6 of 12" in screen.drawn[-1]


def test_links_are_broken_and_mended() -> None:
    """The one that is pointed at, then again as the channel has it; a broken one is mended."""
    assert seen(">b")[2] == {(0, 1): False}
    assert seen(">bb")[2] == {}
    assert seen(">>b")[2] == {(1, 2): True}
    assert seen("0a")[2] == {(0, 1): False}
    assert seen("a")[2] == {(0, 1): True, (1, 2): True}
    assert seen("b")[2] == {}


def test_an_agent_is_chosen_by_its_number_or_in_turn() -> None:
    """And let go by the same key; a number that nobody has chooses nobody."""
    chosen = [seen(keys)[0].state.chosen for keys in ("1", "11", "\t", "\t\t\t", "\t\t\t\t", "7")]
    assert chosen == [1, None, 0, 2, None, None]


def test_speed_is_changed_within_bounds() -> None:
    """Ten frames a second at first."""
    speeds = [seen(keys)[0].state.frames_per_s for keys in ("", "+", "-", "+++++++", "-------")]
    assert speeds == [10, 20, 5, 100, 1]


@pytest.mark.parametrize("size", [(80, 24), (60, 24), (60, 15), (200, 60), (40, 10), (20, 5)])
def test_it_fits_into_the_terminal(size: tuple[int, int]) -> None:
    """No line is longer and there are no more of them than there is room for."""
    lines = text(size=size).split("\n")
    assert max(map(len, lines)) <= size[0]
    assert len(lines) <= size[1]


def test_the_map_is_drawn_cell_by_cell() -> None:
    """Agents by number, an evader by its letter, links that work dotted, broken ones crossed."""
    lines = text(size=(60, 24)).split("\n")
    assert "0······" in lines[3]
    assert lines[3].index("0") == 4  # the frame, and the second of ten cells of two characters
    assert lines[6].count("x") == 1
    assert any("E" in line[:24] for line in lines)


def test_everything_is_said_without_colours() -> None:
    """Who cannot hear whom, how much is lost, and what comes of it, in ASCII if need be."""
    shown = text(signs=ASCII)
    assert shown.isascii()
    for said in ("lost 2 of 4 messages", "1 of 2 links broken", "return -1.5", "catches 1"):
        assert said in shown
    assert [line[-4:] for line in shown.split("\n") if line.endswith(" x")] == ["   x"]


def test_agents_of_one_place_stand_beside_each_other() -> None:
    """And many agents have numbers of two digits."""
    discs = [Disc(0.5, 0.5, 0.01, BLUE, str(number)) for number in (8, 9, 10)]
    crowd = Frame(discs, [], 0)
    shown = watched(crowd, Watching("a run", agents=3), (80, 24), UNICODE).plain
    assert " 1089 " in shown


def test_cells_are_squares() -> None:
    """A character is twice as high as it is wide."""
    assert side_of(50, 20, 15) == (30, 15)
    assert side_of(70, 40, 15) == (60, 30)
    assert side_of(20, 20, 15) == (15, 15)
    assert side_of(50, 20, 0) == (40, 20)
    assert side_of(30, 20, 0) == (30, 15)


def test_who_hears_nobody_has_no_links() -> None:
    """As policies of FDC and those of MADDPG."""
    alone = FRAME._replace(links=[], lost=0, said=0)
    assert "nobody hears anybody" in text(alone)
    assert "messages" not in text(alone)


def test_without_a_terminal_replay_is_named(run: Path) -> None:
    """In one line, at once."""
    said = msgdrop("watch", run)
    assert said.code == 2
    assert said.err.count("\n") == 1
    assert f"msgdrop replay {run} --html" in said.err


def test_what_cannot_be_meant_is_refused(run: Path) -> None:
    """Seeds and speeds that there are not."""
    assert "a seed lies between 1" in msgdrop("watch", run, "--seed", "-1").err
    assert "--speed: expected one of 1, 2" in msgdrop("watch", run, "--speed", "3").err


@pytest.mark.slow
def test_at_a_terminal(run: Path) -> None:
    """Ten frames a second or more, every key named below, and the first screen at the end."""
    command = ("-m", "msgdrop_cli", "watch", str(run), "--broken-links", "half", "--speed", "50")
    with at_a_terminal(*command, columns=60) as terminal:
        terminal.wait_for("step 1,")
        began = time.monotonic()
        terminal.wait_for("ended")
        assert time.monotonic() - began < 25 / 10
        terminal.type("q")
        assert terminal.ended() == 0
    assert LEFT in terminal.seen
    for key in KEYS:
        assert key.encode() in terminal.seen
