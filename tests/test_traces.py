"""Recorded link traces: what is played back, and what is no trace."""

import csv
import json
import random
import re
from collections import Counter
from pathlib import Path

import pytest
import torch

from msgdrop_cli.channels import LOST, Scene, kind_of
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.spec import TrainingSpec
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.store import list_runs
from tests.cli_runs import QUESTION, filled_store, msgdrop
from tests.runs import planned

HEADER = ["step", "receiver", "sender", "age"]
Heard = dict[tuple[int, int, int], int]
"""Step, receiver, sender -> the age of what arrives."""


def everything(agents: int, steps: int) -> Heard:
    """Every message at once."""
    return {
        (step, i, j): 0 for step in range(steps) for i in range(agents) for j in range(agents)
        if i != j
    }  # fmt: skip


def written(folder: Path, heard: Heard, agents: int, steps: int) -> Path:
    """A file in any order; its last row says how long it is and of how many agents."""
    rows: list[list[int | str]] = [[*key, age] for key, age in heard.items()]
    if (steps - 1, agents - 1, 0) not in heard:
        rows.append([steps - 1, agents - 1, 0, ""])
    random.Random(1).shuffle(rows)
    file = folder / "links.csv"
    with file.open("w", newline="") as stream:
        csv.writer(stream).writerows([HEADER, *rows])
    return file


def asked(file: Path, receiver: str = "") -> Channel:
    """The channel as people ask for it."""
    return Channel.read(f"trace:{file}{receiver}").located()


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A policy that listens."""
    root = tmp_path_factory.mktemp("results")
    return train_cohort([planned("dcc-md", train_env_steps=160)], root)[0].path


def test_each_step_is_played_back_as_it_was_recorded(tmp_path: Path) -> None:
    """From wherever an episode begins on, and round again: row by row of the file."""
    agents, steps, games = 4, 7, 60
    choose = random.Random(2)
    heard = {key: choose.choice([0, 0, 1, 3]) for key in everything(agents, steps)}
    heard = {key: age for key, age in heard.items() if choose.random() < 0.6}
    kind = kind_of(asked(written(tmp_path, heard, agents, steps)))
    begins = torch.arange(games) / games
    state = kind.start(begins[:, None], agents)
    for elapsed in range(2 * steps + 1):
        scene = Scene(agents, torch.full((games,), elapsed))
        found = kind.step(state, torch.empty(games, 0), scene)
        state = found.state
        for game in range(games):
            step = (int(begins[game] * steps + 1e-6) + elapsed) % steps
            for i in range(agents):
                senders = [j for j in range(agents) if j != i]
                expected = [heard.get((step, i, j), LOST) for j in senders]
                assert found.age[game, i].tolist() == expected


def test_an_episode_begins_anywhere_in_the_trace(tmp_path: Path) -> None:
    """Each step is as likely as any other (5 sigma)."""
    kind = kind_of(asked(written(tmp_path, everything(2, 5), 2, 5)))
    uniforms = torch.rand(10_000, 1, generator=torch.Generator().manual_seed(3))
    counts = Counter(kind.start(uniforms, 2).tolist())
    assert sorted(counts) == [0, 1, 2, 3, 4]
    assert all(abs(count - 2_000) < 5 * (10_000 * 0.2 * 0.8) ** 0.5 for count in counts.values())


def test_a_trace_of_everything_has_the_bits_of_no_channel(trained: Path, tmp_path: Path) -> None:
    """One of nothing those of all links broken, and one of a fixed age those of a delay."""
    traces = {
        "none": everything(6, 3),
        "all": {},
        "delay:2": dict.fromkeys(everything(6, 3), 2),
    }
    for channel, heard in traces.items():
        file = written(tmp_path, heard, 6, 3)
        rows, expected = (
            [{k: v for k, v in row.items() if k not in ("channel", "broken_links")} for row in rows]
            for rows in (
                evaluate(trained, channel=asked(file), episodes=20),
                evaluate(trained, channel=Channel.read(channel), episodes=20),
            )
        )
        assert rows == expected


def test_a_trace_is_known_by_its_content(tmp_path: Path) -> None:
    """The record has its hash and no path, so that another file of that name is another channel."""
    copy = filled_store(tmp_path)
    file = written(tmp_path, {}, 6, 3)
    line = ("eval", copy.results, "--channel", f"trace:{file}", "--episodes", "4", "--workers", "1")
    assert msgdrop(*line).code == 0
    assert "played anew" not in msgdrop(*line).err
    [key] = {row.get("channel") for row in json.loads(msgdrop(*line, "--json").out)["results"]} - {
        None
    }
    assert re.fullmatch(r"trace:links\.csv@[0-9a-f]{8}", key)
    record = list_runs(copy.results)[0]
    assert Channel.read(key) in record.episodes()
    assert str(tmp_path) not in "".join(map(str, record.episodes()))
    written(tmp_path, everything(6, 3), 6, 3)
    assert "played anew" in msgdrop(*line).err


def test_a_question_finds_its_trace_beside_itself(tmp_path: Path) -> None:
    """Wherever the program runs; one that is not there is named."""
    question = tmp_path / "mine.toml"
    head = 'channels = ["none", "trace:links.csv"]'
    question.write_text(
        QUESTION.replace('environments = ["pursuit-n6"]', f'environments = ["pursuit-n6"]\n{head}')
    )
    with pytest.raises(DefinitionError, match=r"links\.csv: cannot be read: No such file"):
        load_definition(str(question))
    file = written(tmp_path, {}, 6, 3)
    assert asked(file) in load_definition(str(question)).channels


def test_a_question_is_published_with_its_trace(tmp_path: Path) -> None:
    """So that it can be verified there; one that lies elsewhere is refused before anything."""
    (tmp_path / "links").mkdir()
    file = written(tmp_path / "links", everything(6, 40), 6, 40)
    head = 'environments = ["pursuit-n6"]\nchannels = ["none", "trace:links/links.csv"]'
    text = QUESTION.replace('environments = ["pursuit-n6"]', head)
    store = filled_store(tmp_path, text)
    to = tmp_path / "published"
    publish = ("publish", store.question, "--results", store.results, "--to", to)
    said = msgdrop(*publish)
    assert said.code == 0, said.err
    assert (to / "tiny-quick" / "links" / "links.csv").read_bytes() == file.read_bytes()
    said = msgdrop("verify", to)
    assert said.code == 0, said.out
    store.question.write_text(text.replace("links/links.csv", "../links.csv"))
    file.rename(tmp_path.parent / "links.csv")
    said = msgdrop(*publish)
    assert said.code == 2
    assert "to be published it has to lie beside or below the question" in said.err


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "line 1: expected step,receiver,sender,age or step,receiver,sender"),
        (b"# mine\nstep,from,to\n", "line 2: expected step,receiver,sender,age or"),
        (b"step,receiver,sender,age\n", "has no rows"),
        (b"step,receiver,sender\n0,0,1,0\n", "line 2: expected step,receiver,sender, not '0,"),
        (b"step,receiver,sender\n0,0,1\n\n", "line 3: expected step,receiver,sender, not ''"),
        (b"step,receiver,sender\n0,0,1\n0,-1,1\n", "line 3: receiver: expected 0 to 254, not '-1'"),
        (b"step,receiver,sender\n0,0,255\n", "line 2: sender: expected 0 to 254, not '255'"),
        (b"step,receiver,sender\n1e3,0,1\n", "line 2: step: expected 0 to 999,999, not '1e3'"),
        (b"step,receiver,sender,age\n0,0,1,101\n", "line 2: age: expected 0 to 100, not '101'"),
        (b"step,receiver,sender\n0,1,1\n", "line 2: agent 1 is receiver and sender"),
        (b"step,receiver,sender\n0,0,1\n1,0,1\n0,0,1\n",
         "line 4: step 0, receiver 0, sender 1 stands there twice"),
        (b"step,receiver,sender\n999999,0,254\n", "1,000,000 steps of 255 agents are more than"),
        (b"step,receiver,sender\n\xff,0,1\n", "is not in UTF-8"),
        (b"step,receiver,sender\n\x1b[2J,0,1\n", r"line 2: step: expected 0 to 999,999, not"),
    ],
)  # fmt: skip
def test_what_is_no_trace_is_one_line(content: bytes, message: str, tmp_path: Path) -> None:
    """It names the file and the line."""
    file = tmp_path / "links.csv"
    file.write_bytes(content)
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        kind_of(asked(file))
    said = str(caught.value)
    assert f"{file}: " in said
    assert message in said
    assert said.isprintable()


def test_what_is_too_large_or_no_file_is_not_read(tmp_path: Path) -> None:
    """Nor what a pipe would say, or a file that was put in its place."""
    file = tmp_path / "links.csv"
    with file.open("wb") as stream:
        stream.truncate(2**34)
    with pytest.raises(ValueError, match="has more than 16,777,216 bytes"):
        asked(file)
    with pytest.raises(ValueError, match="is no file"):
        asked(tmp_path)
    channel = asked(written(tmp_path, {}, 6, 3))
    written(tmp_path, {}, 6, 4)
    with pytest.raises(ValueError, match="is another file than when it was asked for"):
        kind_of(channel)
    with pytest.raises(ValueError, match="a record names it by its content"):
        kind_of(Channel.read(channel.key))


def test_a_trace_of_other_agents_is_refused(trained: Path, tmp_path: Path) -> None:
    """It says how many it is of."""
    file = written(tmp_path, everything(5, 2), 5, 2)
    with pytest.raises(DefinitionError, match=r"links\.csv is of 5 agents, not of 6"):
        evaluate(trained, channel=asked(file), episodes=2)


@pytest.mark.parametrize("text", ["trace", "trace:", "trace:\0", "loss:a@0123abcd"])
def test_a_trace_needs_a_file(text: str) -> None:
    """And nothing else does."""
    with pytest.raises(ValueError, match="expected none, half, all, a share"):
        Channel.read(text)


@pytest.mark.parametrize("end", [b"\r\n", b"\n"])
def test_comments_marks_and_line_ends_of_other_systems_are_read(end: bytes, tmp_path: Path) -> None:
    """What spreadsheets write, too; without ages everything is of its own step."""
    file = tmp_path / "a b.csv"
    lines = [b"\xef\xbb\xbf# a field test", b"step,receiver,sender", b"1,0,1", b"# note", b"0,1,0"]
    file.write_bytes(end.join(lines) + end)
    channel = asked(file, "+hold:2")
    assert channel.key.startswith("trace:a-b.csv@")
    kind = kind_of(channel)
    step = kind.step(torch.tensor([0, 1]), torch.empty(2, 0), Scene(2, torch.zeros(2)))
    assert step.age[:, :, 0].tolist() == [[LOST, 0], [0, LOST]]


def test_training_through_a_trace_is_refused() -> None:
    """A run is told by its settings, and these have no file."""
    with pytest.raises(ValueError, match="channel: a recorded trace is for eval"):
        TrainingSpec(channel="trace:links.csv")


def test_the_trace_of_the_page_is_one(tmp_path: Path) -> None:
    """docs/channels.md shows a file that can be played back."""
    page = (Path(__file__).parents[1] / "docs" / "channels.md").read_text()
    [shown] = re.findall(r"```\n(# .*?step,receiver.*?)```", page, re.DOTALL)
    file = tmp_path / "links.csv"
    file.write_text(shown)
    found = asked(file).file
    assert found is not None
    assert f"`trace:{found}`" in page
    trace = found.trace()
    assert (trace.agents, trace.steps) == (6, 2)
    assert [age for age in trace.ages if age != LOST] == [0, 2]
