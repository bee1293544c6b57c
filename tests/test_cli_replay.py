"""`msgdrop replay`: the episode of the evaluation, in one file that needs nothing else."""

import json
import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
import torch
from PIL import Image

from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.engine.episode import Episode, Frame, Link, _links, play_episode
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.errors import to_install
from msgdrop_cli.report.replay import _ffmpeg, moving_picture, page
from msgdrop_envs import autoreset, registry
from msgdrop_envs.drawing import BLUE, Disc
from tests.cli_runs import msgdrop
from tests.runs import planned

HALF = Channel.read(0.5)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that was trained for a moment."""
    plan = planned("dcc-md", environment="navigation-n8", time_limit=25, train_env_steps=160)
    [outcome] = train_cohort([plan], tmp_path_factory.mktemp("results"))
    return outcome.path


def data(content: bytes) -> Any:
    """What a page shows."""
    [text] = re.findall(r"^const episode = (.*);$", content.decode(), re.MULTILINE)
    return json.loads(text)


def test_it_is_the_episode_of_the_evaluation(run: Path) -> None:
    """The same policy, seed and channel give the same one; another seed gives another."""
    episode = play_episode(run, channel=HALF)
    [row] = evaluate(run, channel=HALF, episodes=1)
    assert f"return {row['return']}" in episode.outcome
    assert len(episode.frames) == row["steps"] == 25
    assert play_episode(run, channel=HALF) == episode
    assert play_episode(run, channel=HALF, seed=2).frames != episode.frames
    assert play_episode(run, channel=NONE_BROKEN).frames != episode.frames


def test_broken_links_are_those_of_the_channel(run: Path) -> None:
    """Half of 28 links lose both their messages in every step; none does without broken links."""
    for frame in play_episode(run, channel=HALF).frames:
        assert sum(not link.works for link in frame.links) == 14
        assert (len(frame.links), frame.lost) == (28, 28)
    assert {frame.lost for frame in play_episode(run, channel=NONE_BROKEN).frames} == {0}


def test_a_link_works_if_both_messages_arrive() -> None:
    """Of three agents in a ring each hears its left one; only the message to agent 1 is lost."""
    keep = torch.ones(1, 1, 3, 2)
    keep[0, 0, 1, 0] = 0.0
    links, lost = _links([[2], [0], [1]], keep)
    assert sorted(links) == [Link(0, 1, False), Link(0, 2, True), Link(1, 2, True)]
    assert lost == 1
    assert _links([[], [], []], keep) == ([], 0)


@pytest.mark.parametrize(
    "name", sorted(n for n, config in registry.settings().items() if registry.view(config))
)
def test_scenes_begin_with_the_agents(name: str) -> None:
    """In their order, on the picture, at every start."""
    env, view = registry.make(name), registry.view(registry.settings()[name])
    assert view is not None
    uniforms = torch.rand(env.reset_uniforms, generator=torch.Generator().manual_seed(1))
    games = autoreset.start(env, uniforms, torch.tensor(0))
    discs = view.scene(games.state)
    assert [disc.label for disc in discs[: env.agents]] == [*map(str, range(env.agents))]
    assert not any(disc.label for disc in discs[env.agents :])
    assert all(0.0 <= disc.x <= 1.0 and 0.0 <= disc.y <= 1.0 for disc in discs)


def test_the_page_is_one_file(run: Path, tmp_path: Path) -> None:
    """It loads nothing, has a slider, and holds every step."""
    said = msgdrop("replay", run, "--html", tmp_path / "a.html", "--broken-links", "half")
    assert said.code == 0, said.err
    content = (tmp_path / "a.html").read_bytes()
    assert not re.search(rb"https?:|src=|<link|@import", content)
    assert b'type="range"' in content
    shown = data(content)
    assert shown["agents"] == [f"agent_{number}" for number in range(8)]
    assert len(shown["frames"]) == 25
    assert content == page(play_episode(run, channel=HALF))


def test_words_cannot_leave_the_pages_data() -> None:
    """A name that looks like the end of the script stays a name."""
    frame = Frame([Disc(0.5, 0.5, 0.1, BLUE, "</script>")], [], 0)
    content = page(Episode("a <b>", ("</script>",), [frame], ""))
    assert content.count(b"</script>") == 1
    assert data(content)["agents"] == ["</script>"]


def test_a_moving_picture_shows_every_step(run: Path, tmp_path: Path) -> None:
    """10 frames a second; nothing is written into the run."""
    before = sorted(run.iterdir())
    said = msgdrop("replay", run, "--gif", tmp_path / "a.gif", "--channel", "links:0.5")
    assert said.code == 0, said.err
    with Image.open(tmp_path / "a.gif") as image:
        assert (image.n_frames, image.info["duration"]) == (25, 100)  # type: ignore[attr-defined]
    assert sorted(run.iterdir()) == before


@pytest.mark.slow
def test_a_long_episode_stays_small() -> None:
    """Eight agents and their 28 links for 500 steps: at most 5 MB."""
    rows = torch.rand(500, 8, 2, generator=torch.Generator().manual_seed(1)).tolist()
    links = [Link(i, j, (i + j) % 3 > 0) for j in range(8) for i in range(j)]
    frames = [
        Frame([Disc(x, y, 0.03, BLUE, str(n)) for n, (x, y) in enumerate(row)], links, 9)
        for row in rows
    ]
    episode = Episode("long", tuple("abcdefgh"), frames, "")
    assert len(page(episode)) < 1_000_000
    assert len(moving_picture(episode)) < 5_000_000


def test_a_film_shows_every_step(run: Path, tmp_path: Path) -> None:
    """As another program counts them."""
    if not (shutil.which("ffmpeg") or find_spec("imageio_ffmpeg")):
        pytest.skip("there is no ffmpeg here")
    said = msgdrop("replay", run, "--mp4", tmp_path / "a.mp4", "--channel", "links:0.5")
    assert said.code == 0, said.err
    done = subprocess.run(
        [_ffmpeg(), "-i", tmp_path / "a.mp4", "-f", "framecrc", "-"],
        capture_output=True,
        check=True,
    )
    lines = [line for line in done.stdout.splitlines() if not line.startswith(b"#")]
    assert len(lines) == 25
    assert b"10 fps" in done.stderr


def test_without_ffmpeg_a_film_is_refused(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a line that says how to get it; nothing is written."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    said = msgdrop("replay", run, "--mp4", tmp_path / "a.mp4")
    assert said.code == 2
    assert to_install("video") in said.err.splitlines()[-1]
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_shown_is_refused_in_a_line(run: Path, tmp_path: Path) -> None:
    """Nothing to write, two channels, no run, a folder that is not there."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for arguments, said in (
        ((run,), "say what to write: --html FILE, --gif FILE or --mp4 FILE"),
        ((run, "--html", tmp_path / "a", "--gif", tmp_path / "." / "a"), "would be written twice"),
        ((run, "--gif", pipe), "is there and is no file"),
        ((run, "--html", tmp_path / "a", "--seed", "-1"), "--seed: a seed lies between 1 and"),
        (
            (run, "--html", "a", "--channel", "links:0.5", "--broken-links", "half"),
            "--channel and --broken-links: give one of both",
        ),
        ((tmp_path, "--html", "a"), "is no run's folder"),
        ((run, "--html", tmp_path / "no" / "a.html"), "a.html"),
    ):
        answer = msgdrop("replay", *arguments)
        assert answer.code in (2, 73, 74), answer.err
        assert said in answer.err.splitlines()[-1]
