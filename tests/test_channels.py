"""Every kind of channel, and the seam: one file in the folder is evaluated, recorded and shown.

The kinds in `toy_channels` are found as if they stood in the folder.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch
from torch import Tensor

from msgdrop_cli import channels
from msgdrop_cli.channels import LOST, Scene, kind_of, kinds
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine.delivery import Delivery
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.store import list_runs
from msgdrop_envs import autoreset, registry
from tests.cli_runs import QUESTION, Store, copied_store, filled_store, msgdrop
from tests.runs import planned

TOYS = ("coin", "from-step")
RUNS, GAMES = 2, 5
FLAT = (
    *("links:0.3", "coin:0.3", "from-step:3", "loss:0.5", "links-step:0.5", "bursts:0.3,4"),
    *("tmc-heavy", "one-way:0.5", "silent:1", "delay:2", "jitter:0,3", "within:3", "distance:9"),
    *("noise:1", "constant", "shuffled", "swapped", "own", "worst:1", "loss:0.5+hold:2"),
    *("loss:0.5+mean", "half+scale:one", "half+scale:delivered"),
)


@pytest.fixture(autouse=True)
def toys() -> Iterator[None]:
    """Two more files in the folder."""
    folder = str(Path(__file__).parent / "toy_channels")
    channels.__path__.append(folder)
    yield
    channels.__path__.remove(folder)
    for toy in TOYS:
        sys.modules.pop(f"msgdrop_cli.channels.{toy.replace('-', '_')}", None)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs, evaluated with all links."""
    return filled_store(tmp_path_factory.mktemp("cli"))


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A policy that listens, and one that does not."""
    root = tmp_path_factory.mktemp("results")
    return {
        name: train_cohort([planned(name, train_env_steps=160)], root)[0].path
        for name in ("dcc-md", "fdc")
    }


def numbers(count: int) -> Tensor:
    """Uniform numbers of every run and game."""
    return torch.rand(RUNS, GAMES, count, generator=torch.Generator().manual_seed(count))


def test_kinds_are_found_by_their_files() -> None:
    """The folder's and ours, called like their files."""
    assert {"links", *TOYS} <= set(kinds())


def scene(agents: int, step: int) -> Scene:
    """A step of every game, with agents anywhere."""
    where = 20 * numbers(2 * agents).view(RUNS, GAMES, agents, 2)
    return Scene(agents, torch.full((RUNS, GAMES), step), where)


@pytest.mark.parametrize("agents", [2, 3, 8])
@pytest.mark.parametrize("name", [*kinds(), *TOYS])
def test_every_kind_keeps_the_contract(name: str, agents: int, tmp_path: Path) -> None:
    """Ages for every message, from what it was given alone, each game by itself."""
    file = tmp_path / "links.csv"
    file.write_text(f"step,receiver,sender,age\n2,0,{agents - 1},1\n0,1,0,0\n")
    trace = Channel.read(f"trace:{file}").located()
    channel = trace if name == "trace" else Channel(name, kinds()[name].example)
    assert Channel.read(channel.key) == channel
    kind = kind_of(channel)
    state = kind.start(numbers(kind.episode_uniforms(agents)), agents)
    for number in range(4):
        uniforms, now = numbers(kind.step_uniforms(agents)), scene(agents, number)
        before = state.clone()
        found = kind.step(state, uniforms, now)
        age, after = found.age, found.state
        assert torch.equal(state, before)
        assert (age.shape, age.dtype) == ((RUNS, GAMES, agents, agents - 1), torch.uint8)
        assert set(age.unique().tolist()) <= {*range(kind.oldest + 1), LOST}
        assert (after.shape, after.dtype) == (state.shape, state.dtype)
        some = torch.tensor([3, 1])
        assert now.positions is not None
        few = Scene(agents, now.elapsed[:, some], now.positions[:, some])
        alone = kind.step(state[:, some], uniforms[:, some], few)
        assert torch.equal(alone.age, age[:, some])
        assert torch.equal(alone.state, after[:, some])
        state = after


def played(path: Path, text: str) -> list[object]:
    """What happened in thirty episodes through this channel, without its name."""
    rows = evaluate(path, channel=Channel.read(text), episodes=30)
    return [list(row.items())[1:] for row in rows]


def test_losing_nothing_has_the_bits_of_no_channel(trained: dict[str, Path]) -> None:
    """And losing everything those of all links broken, step by step or once an episode."""
    whole, broken = (played(trained["dcc-md"], text) for text in ("none", "all"))
    assert whole != broken
    assert played(trained["dcc-md"], "coin:0") == played(trained["dcc-md"], "from-step:0") == whole
    assert played(trained["dcc-md"], "coin:1") == broken
    assert played(trained["dcc-md"], "from-step:10000") == broken


def test_a_channel_knows_what_it_needs_from_the_step_before(trained: dict[str, Path]) -> None:
    """Three deaf steps are neither none nor all; and the same numbers give the same rows."""
    three = played(trained["dcc-md"], "from-step:3")
    assert three == played(trained["dcc-md"], "from-step:3")
    assert three not in (played(trained["dcc-md"], "none"), played(trained["dcc-md"], "all"))
    assert played(trained["dcc-md"], "coin:0.3") != played(trained["dcc-md"], "links:0.3")


def test_an_episode_has_its_own_numbers_when_others_have_ended() -> None:
    """What arrives in it does not depend on how long the others last."""
    everybody, some = torch.arange(6), torch.tensor([4, 1])
    env = registry.make(registry.settings()["pursuit-n6"], "cpu")
    games = autoreset.start(env, torch.rand(1, 6, env.reset_uniforms), torch.zeros(1, 6).long())
    whole, ended = (Delivery(Channel.read("coin:0.5"), env, Streams([1]), 6) for _ in "ab")
    whole(games, everybody, games.obs)
    ended(games, everybody, games.obs)
    expected = whole(games, everybody, games.obs)
    found = ended(autoreset.take(games, some), some, games.obs[:, some])
    assert torch.equal(found.keep, expected.keep[:, some])


@pytest.mark.parametrize("text", FLAT)
def test_who_hears_nobody_meets_the_same_games(text: str, trained: dict[str, Path]) -> None:
    """FDC's rows do not change, since no channel takes a number from the games."""
    assert played(trained["fdc"], text) == played(trained["fdc"], "none")


def test_a_channel_goes_from_the_command_line_to_the_table(store: Store, tmp_path: Path) -> None:
    """Played, recorded by its key, shown by its words, and not played again."""
    copy = copied_store(store, tmp_path)
    asked = ("--broken-links", "half", "--channel", "coin:0.3", "--episodes", "8", "--workers", "1")
    said = msgdrop("eval", copy.results, *asked)
    assert said.code == 0, said.err
    for words in ("Channels, pursuit-n6", "none broken", "half broken", "coin 0.3"):
        assert words in " ".join(said.out.split())
    for record in list_runs(copy.results):
        rows = record.episodes()[Channel.read("coin:0.3")]
        assert [row["episode"] for row in rows] == list(range(8))
        assert {row["channel"] for row in rows} == {"coin:0.3"}
        assert not any("broken_links" in row for row in rows)
    again = msgdrop("eval", copy.results, *asked, "--json")
    assert "played anew" not in again.err
    rows = json.loads(again.out)["results"]
    assert {(row.get("broken_links"), row.get("channel")) for row in rows} == {
        (0.0, None), (0.5, None), (None, "coin:0.3"),
    }  # fmt: skip
    assert msgdrop("plot", copy.results).code == 0


@pytest.mark.parametrize(
    ("channel", "message"),
    [
        ("coi:0.3", "--channel: no channel is called 'coi'; did you mean 'coin'?"),
        ("coin", "--channel: coin: expected coin:RATE (coin:0.3)"),
        ("coin:3", "--channel: coin:3: rate must lie between 0 and 1, not 3.0"),
        ("coin:", "--channel: expected none, half, all, a share"),
    ],
)
def test_a_channel_that_there_is_not_is_one_line(channel: str, message: str, store: Store) -> None:
    """Before anything is played."""
    said = msgdrop("eval", store.results, "--channel", channel)
    assert (said.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert message in said.err


@pytest.mark.parametrize(
    ("channel", "message"),
    [
        ("silent:7", "the number of silent agents is at most 6 among 6 agents, not 7"),
        ("nearest:6", "the number of agents that are heard is at most 5 among 6 agents, not 6"),
        ("worst:16", "the number of links is at most 15 among 6 agents, not 16"),
    ],
)
def test_more_than_a_game_has_is_one_line(
    channel: str, message: str, store: Store, tmp_path: Path
) -> None:
    """Before anything is played, of policies and of questions; what there is, is taken."""
    line = f"pursuit-n6, channel {channel}: {message}"
    said = msgdrop("eval", store.results, "--channel", channel, "--episodes", "5")
    assert (said.code, said.out, "evaluating" in said.err) == (2, "", False)
    assert line in said.err
    question = definition(tmp_path, f'channels = ["none", "{channel}"]')
    said = msgdrop("ablate", question, "--profile", "quick", "--dry-run", "--results", tmp_path)
    assert (said.code, said.out) == (2, "")
    assert line in said.err
    kind, _, most = channel.partition(":")
    kind_of(Channel(kind, (float(most) - 1,))).check(6)


def definition(folder: Path, channels_line: str, claim_line: str = "") -> str:
    """A question's file with these lines in its head and in its claim."""
    file = folder / "mine.toml"
    head = f'environments = ["pursuit-n6"]\n{channels_line}'
    file.write_text(QUESTION.replace('environments = ["pursuit-n6"]', head) + claim_line)
    return str(file)


def test_a_definition_asks_for_channels(tmp_path: Path) -> None:
    """In its head, and in a claim about one of them."""
    file = definition(tmp_path, 'channels = ["none", 0.3, "coin:0.3"]', 'channel = "coin:30%"')
    made = plan(load_definition(file), "quick", catalogue())
    assert [channel.key for channel in made.channels] == ["links:0", "links:0.3", "coin:0.3"]
    assert [claim.channel.key for claim in made.claims] == ["coin:0.3"]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('channels = ["none", "coi:0.3"]',
         "channels: no channel is called 'coi'; did you mean 'coin'?"),
        ('channels = ["none", "links:0"]', "expected at least one channel, each only once"),
        ("channels = []", "expected at least one channel, each only once"),
        ("channels = 0.5", "channels: expected a list [a channel, ...], not 0.5"),
        ("channels = [0]\nbroken_links = [0]",
         "channels and broken_links are two words for one thing; keep one"),
    ],
)  # fmt: skip
def test_a_definition_says_where_a_channel_is_wrong(
    line: str, message: str, tmp_path: Path
) -> None:
    """When it is read, or when it is planned, which is when kinds are known."""
    file = definition(tmp_path, line)
    with pytest.raises(DefinitionError) as caught:
        plan(load_definition(file), "quick", catalogue())
    assert str(caught.value) == f"{file}: {message}"
