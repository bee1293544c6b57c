"""A channel's setting over a range: how it is asked for, and what is read off the curves."""

import csv
import io
import json
import re
import shutil
from pathlib import Path

import pytest

from msgdrop_cli.analysis.sweeps import NEVER, first_below, mean_height
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.sweep import Sweep
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.store import list_runs
from tests.cli_runs import QUESTION, Said, Store, copied_store, msgdrop


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs, of FDC and DCC."""
    folder = tmp_path_factory.mktemp("cli")
    question = folder / "tiny.toml"
    told = QUESTION.partition("[[claims]]")[0]
    told = told.replace('[variants."md-0.2"]', "[variants.fdc]")
    question.write_text(told.replace('"dcc-md", rate = 0.2', '"fdc"'))
    empty = Store(question, folder / "results", Said(0, "", ""))
    return empty._replace(said=empty.ablate())


LOSSES = ("loss:0", "loss:0.1", "loss:0.2", "loss:0.3")
MEANS = ("delay:1+mean", "delay:2+mean", "delay:3+mean")
NO_RANGES = (
    *("loss", "loss:0.5", "loss:0..1", "loss:1..0:3", "loss:0..1:1", "loss:0..1:1000"),
    *("bursts:0..1:3,0..1:3", "delay:0..2:3e1", "loss:0..1:3%", "loss:0..1:2.5"),
)


@pytest.mark.parametrize(
    ("text", "values", "keys", "name"),
    [
        ("loss:0..1:3", (0, 0.5, 1), ("loss:0", "loss:0.5", "loss:1"), "loss"),
        ("loss:0..30%:4", (0, 0.1, 0.2, 0.3), LOSSES, "loss"),
        ("links:0..1:2", (0, 1), ("links:0", "links:1"), "links"),
        ("bursts:0..0.5:2,4", (0, 0.5), ("bursts:0,4", "bursts:0.5,4"), "bursts x,4"),
        ("delay:1..3:3+mean", (1, 2, 3), MEANS, "delay x+mean"),
        ("bursts:0.2,1..9:2", (1, 9), ("bursts:0.2,1", "bursts:0.2,9"), "bursts 0.2,x"),
    ],
)
def test_a_range_is_read(
    text: str, values: tuple[float, ...], keys: tuple[str, ...], name: str
) -> None:
    """Any setting of any kind, with what receivers do."""
    found = Sweep.read(text, "--sweep")
    assert found.values == values
    assert [channel.key for channel in found.channels] == list(keys)
    assert found.name == name


@pytest.mark.parametrize("text", NO_RANGES)
def test_what_is_no_range_is_refused(text: str) -> None:
    """In one line that names the option and shows an example or the bounds."""
    with pytest.raises(DefinitionError, match=r"--sweep: expected .*(loss:0\.\.1:11|2 to 101)"):
        Sweep.read(text, "--sweep")


def test_the_mean_height_is_the_area_by_the_width() -> None:
    """Of straight lines through points that need not be equally far apart."""
    assert mean_height([0, 1, 4], [2, 4, 1]) == pytest.approx((3 + 7.5) / 4)
    assert mean_height([0.2, 0.4], [5, 5]) == 5


@pytest.mark.parametrize(
    ("heights", "place"),
    [([1, -1, 3], 0.5), ([3, 1, -3], 1.25), ([-1, 2, 2], 0.0), ([1, 0, 1], NEVER), ([0, -1, 0], 0)],
)
def test_a_fall_is_where_a_line_goes_below(heights: list[float], place: float) -> None:
    """By straight lines; touching is no fall."""
    assert first_below([0, 1, 2], heights) == place


def test_a_sweep_goes_from_the_command_line_to_the_figure(store: Store, tmp_path: Path) -> None:
    """Played at every setting, shown, drawn, and written as numbers; FDC is exactly flat."""
    copy = copied_store(store, tmp_path)
    asked = ("--sweep", "loss:0..1:3", "--episodes", "8", "--workers", "1")
    said = msgdrop("unstable-test", copy.results, *asked)
    assert said.code == 0, said.err
    told = ("8 episodes a seed and setting", "(random)", "(scripted)", "that learn nothing")
    for words in ("loss:0..1:3, pursuit-n6", "loss 0.5", "below FDC from", *told):
        assert words in " ".join(said.out.split())
    figure, numbers = (Path(line.split()[1]) for line in said.out.splitlines() if "wrote" in line)
    assert figure.read_bytes().startswith(b"\x89PNG")
    lines = list(csv.DictReader(io.StringIO(numbers.read_text())))
    assert len(lines) == 4 * 3
    flat = {line["seed"]: line["catches_per_500"] for line in lines if line["variant"] == "fdc"}
    deaf = [line for line in lines if line["variant"] == "fdc"]
    assert len(deaf) == 2 * 3
    assert all(line["catches_per_500"] == flat[line["seed"]] for line in deaf)
    again = msgdrop("unstable-test", copy.results, *asked, "--json")
    assert "played anew" not in again.err
    shown = json.loads(again.out)
    assert [arm["settings"] for arm in shown["arms"]] == [[0, 0.5, 1]] * 2
    falls = {arm["variant"]: arm["falls_by_seed"] for arm in shown["arms"]}
    assert (set(falls["dcc"]), falls["fdc"]) == ({"1", "2"}, {})
    played = {channel for record in list_runs(copy.results) for channel in record.episodes()}
    assert Channel.read("loss:0.5") in played


def test_a_sweep_and_a_channel_are_two_questions(store: Store) -> None:
    """One of them is to be asked."""
    said = msgdrop(
        "unstable-test", store.results, "--sweep", "loss:0..1:3", "--channel", "loss:0.1"
    )
    assert said.code == 2
    assert "expected one of --sweep, --links" in said.err


def test_many_channels_are_a_map(store: Store, tmp_path: Path) -> None:
    """Rows of the table, and one figure with a cell for each variant and channel."""
    copy = copied_store(store, tmp_path)
    channels = ("loss:0.2", "delay:1", "silent:1", "own")
    asked = [word for each in channels for word in ("--channel", each)]
    said = msgdrop("unstable-test", copy.results, *asked, "--episodes", "4", "--workers", "1")
    assert said.code == 0, said.err
    rows = [line.split() for line in said.out.splitlines() if line.strip()]
    assert ["seeds", "2", "2"] in [row[:3] for row in rows]
    assert {"delay", "loss", "none", "own", "silent"} <= {row[0] for row in rows}
    figures = [path.name for path in (copy.results / "figures" / "unstable-test").glob("*.png")]
    assert [name for name in figures if "broken-links" in name or "matrix" in name] == [
        "pursuit-n6-quick-200-matrix.png"
    ]


def test_each_link_has_its_worth(store: Store) -> None:
    """One line a policy, with all 15 links of six agents; nobody who hears nobody loses by one."""
    said = msgdrop("unstable-test", store.results, "--links", "--json")
    assert said.code == 0, said.err
    found = {(each["variant"], each["seed"]): each for each in json.loads(said.out)}
    assert set(found) == {("fdc", 1), ("fdc", 2), ("dcc", 1), ("dcc", 2)}
    for (variant, _), each in found.items():
        costs = [link["costs"] for link in each["links"]]
        assert len({tuple(link["agents"]) for link in each["links"]}) == 15
        assert costs == sorted(costs, reverse=True)
        assert (set(costs) == {0.0}) == (variant == "fdc")


def test_links_are_tried_in_as_many_episodes_as_asked(store: Store) -> None:
    """Another number of them gives another mean; the option is no decoration."""
    few, more = (
        json.loads(msgdrop("unstable-test", store.results, "--links", "--json", *asked).out)
        for asked in (("--episodes", "2"), ("--episodes", "3"))
    )
    assert [each["episodes"] for each in (*few, *more)] == [2] * 4 + [3] * 4
    assert [each["return"] for each in few] != [each["return"] for each in more]


def test_links_need_no_workers(store: Store) -> None:
    """What would do nothing is refused, in one line."""
    said = msgdrop("unstable-test", store.results, "--links", "--workers", "3")
    assert (said.code, said.out) == (2, "")
    assert said.err == "msgdrop: error: --workers: --links plays in one process; leave it out\n"


def test_a_small_range_keeps_its_settings() -> None:
    """However small they are."""
    found = Sweep.read("noise:0..1e-30:3", "--sweep")
    assert found.values == (0.0, 5e-31, 1e-30)
    assert len(set(found.channels)) == 3


def test_points_that_are_one_number_are_refused() -> None:
    """In the twelve digits that they are written in."""
    with pytest.raises(DefinitionError, match=r"^--sweep: the points of 'loss:.*' lie too near$"):
        Sweep.read("loss:0.30000000000001..0.30000000000002:11", "--sweep")


def test_one_published_seed_is_shown_as_such(store: Store, tmp_path: Path) -> None:
    """A dash for its spread as in every table, and whose runs they are."""
    copy = tmp_path / "results" / "published" / "study" / "pursuit-n6"
    for record in list_runs(store.results):
        if record.seed == 1:
            shutil.copytree(record.path, copy / record.path.name)
    asked = ("--sweep", "loss:0..1:2", "--episodes", "4", "--workers", "1")
    said = msgdrop("unstable-test", copy.parent, *asked)
    assert said.code == 0, said.err
    rows = {line.split()[0]: line.split() for line in said.out.splitlines() if "[" in line}
    assert rows["DCC-MD"][-2:] == ["[\u2013]", "\u2013"]
    assert rows["DCC"][-1] == "[\u2013]"
    assert "2 of 2 runs published: study (2)" in " ".join(said.out.split())
    [drawn] = (tmp_path / "results").rglob("*sweep*.svg")
    below = " ".join(re.findall("<!-- (.*?) -->", drawn.read_text()))
    assert "without an epsilon" not in below
    for words in ("4 episodes a seed", "2 of 2 runs published: study (2)", "that learn nothing"):
        assert words in below


def test_beside_an_epsilon_the_references_are_said_to_have_none(
    store: Store, tmp_path: Path
) -> None:
    """They were played as they are: no number in the table, and a word below the figure."""
    copy = copied_store(store, tmp_path)
    asked = ("--sweep", "loss:0..1:2+epsilon:0.1", "--episodes", "2", "--workers", "1")
    said = msgdrop("unstable-test", copy.results, *asked)
    assert said.code == 0, said.err
    [row] = [line.split() for line in said.out.splitlines() if line.startswith("(random)")]
    assert set(row[1:]) == {"\u2013"}
    [drawn] = copy.results.rglob("*sweep*.svg")
    below = " ".join(re.findall("<!-- (.*?) -->", drawn.read_text()))
    assert "act without an epsilon" in below
