"""Reference policies on their way from the game to tables, figures and published folders."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.analysis.summary import Summary, summarise
from msgdrop_cli.commands.parts.find_references import references_of
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.engine.play_references import play_references
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.references import (
    Policy,
    References,
    find_references,
    game_key,
    keep_references,
)
from msgdrop_cli.report.bars import draw_channels
from msgdrop_cli.report.figures import draw_learning
from msgdrop_cli.report.table import channels_table, results_table
from tests.fake_runs import GROUP, write_run
from tests.runs import planned

GAME = {"name": "pursuit-n6"}
KNOWN = References(
    episodes=200,
    seed=1,
    commit=None,
    policies={
        "random": Policy(meaning="any action", metrics={"catches_per_500": 0.5}),
        "scripted": Policy(meaning="knows it all", metrics={"catches_per_500": 62.0}),
    },
)


def game(time_limit: int) -> dict[str, Any]:
    """The spec of a run whose games are short."""
    return spec_to_dict(planned(time_limit=time_limit).spec)


def summary(root: Path) -> Summary:
    """One run with catches 1 to 4 while training, evaluated in two channels."""
    run = write_run(root, "dcc", 1, catches={0.0: 3, 0.5: 2})
    return summarise([run], references={game_key(GAME): KNOWN})


def test_tables_end_with_the_reference_policies(tmp_path: Path) -> None:
    """In brackets, without seeds or intervals, the same in every channel; the caption says who."""
    found = summary(tmp_path)
    table = results_table(found, GROUP)
    assert [row[:4] for row in table.rows[1:]] == [
        ("(random)", "\u2013", "0.50", "\u2013"),
        ("(scripted)", "\u2013", "62.0", "\u2013"),
    ]
    assert "200 episodes each: (random) any action; (scripted) knows it all." in table.caption
    assert channels_table(found, GROUP).rows[1] == ("(random)", "\u2013", "0.50", "0.50")


@pytest.mark.parametrize("draw", [draw_learning, draw_channels])
def test_figures_draw_what_is_near_and_tell_what_is_far(tmp_path: Path, draw: object) -> None:
    """A dotted line at 0.5 beside its name; 62 would flatten the curves and stands below."""
    assert callable(draw)
    figure = draw(summary(tmp_path), GROUP).figure
    axes = figure.axes[0]
    dotted = [line for line in axes.lines if list(line.get_ydata()) == [0.5, 0.5]]
    assert len(dotted) == 1
    assert "(random)" in [text.get_text() for text in axes.texts]
    footer = " ".join(figure.texts[0].get_text().split())
    assert "policies that learn nothing, 200 episodes each. Not drawn: (scripted) 62." in footer
    assert axes.get_ylim()[1] < 10


def test_beside_policies_that_act_at_random_at_times_they_do_not_stand(tmp_path: Path) -> None:
    """They were played without an epsilon: a table has a dash there, a figure says so."""
    run = write_run(tmp_path, "dcc", 1, catches={0.0: 3, 0.5: 2})
    rows = (run.path / "episodes.jsonl").read_text()
    exploring = rows.replace('"broken_links": 0.5', '"channel": "links:0+epsilon:0.02"')
    (run.path / "episodes.jsonl").write_text(exploring)
    found = summarise([run], references={game_key(GAME): KNOWN})
    assert channels_table(found, GROUP).rows[1] == ("(random)", "\u2013", "0.50", "\u2013")
    alone = results_table(found, GROUP, Channel.read("none+epsilon:0.02"))
    assert alone.rows[1][:3] == ("(random)", "\u2013", "\u2013")
    assert "greedy" not in alone.caption
    drawn = draw_channels(found, GROUP)
    assert drawn is not None
    footer = " ".join(drawn.figure.texts[0].get_text().split())
    assert "Not drawn: (scripted) 62. These act without an epsilon." in footer


def test_arms_under_different_rules_have_no_common_reference(tmp_path: Path) -> None:
    """A line that holds for half of the curves would mislead."""
    one = write_run(tmp_path, "dcc", 1, catches={0.0: 3})
    other = write_run(tmp_path, "fdc", 1, catches={0.0: 3})
    other.run["spec"]["environment"] = {"name": "pursuit-n6", "sight": 2}
    assert summarise([one, other], references={game_key(GAME): KNOWN}).references_of(GROUP) is None


def test_what_is_played_is_that_game(tmp_path: Path) -> None:
    """The settings count: with a time limit of 7 nobody plays longer; numbers repeat."""
    table = play_references(game(7), "here")
    assert table["policies"]["nothing"]["metrics"]["steps_to_finish"] == 7.0
    assert table["policies"]["nothing"]["metrics"]["return_per_episode"] == pytest.approx(-2.1)
    assert table == play_references(game(7), "here")


def test_they_are_played_once_and_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second time they come from the file; other settings would be another file."""
    run = write_run(tmp_path, "dcc", 1, spec=game(3))
    first = references_of([run], tmp_path)
    key = game_key(game(3)["environment"])
    assert set(first) == {key}
    assert key != game_key(game(4)["environment"])
    monkeypatch.setattr("msgdrop_cli.engine.play_references.play_references", None)
    assert references_of([run], tmp_path) == first


def test_a_folder_that_is_not_ours_does_not_matter(tmp_path: Path) -> None:
    """Where nothing can be kept the policies are shown all the same."""
    run = write_run(tmp_path, "dcc", 1, spec=game(3))
    (tmp_path / "references").write_text("a file where the folder would be")
    assert len(references_of([run], tmp_path)) == 1


def test_a_game_of_another_program_has_none(tmp_path: Path) -> None:
    """No error: its runs are shown without."""
    run = write_run(tmp_path, "dcc", 1)
    run.run["spec"]["environment"]["name"] = "no-game-of-ours"
    assert references_of([run], tmp_path) == {}


def as_folder(path: Path) -> None:
    """Put an empty folder in a file's place."""
    path.unlink()
    path.mkdir()


def as_link(path: Path) -> None:
    """Put a link in a file's place."""
    path.rename(path.with_name("other"))
    path.symlink_to("other")


DAMAGE: dict[str, Callable[[Path], object]] = {
    "no JSON": lambda path: path.write_text("{"),
    "a list": lambda path: path.write_text("[]"),
    "a folder": as_folder,
    "a link": as_link,
    "no number": lambda path: path.write_text(json.dumps({"episodes": "many"})),
    "episodes below 1": lambda path: rewrite(path, episodes=-3),
    "no policies": lambda path: rewrite(path, policies={}),
    "no metrics": lambda path: rewrite(path, policies={"r": {"meaning": "m", "metrics": {}}}),
}


def rewrite(path: Path, **changes: Any) -> None:
    """Put other values into a file of references."""
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


@pytest.mark.parametrize("damage", DAMAGE)
def test_damage_is_one_line(damage: str, tmp_path: Path) -> None:
    """A file that does not say what it should names itself."""
    path = keep_references(tmp_path, "some-game", dataclasses.asdict(KNOWN))
    assert find_references(tmp_path, "some-game") == KNOWN
    DAMAGE[damage](path)
    with pytest.raises(RecordError, match=r"some-game\.json") as caught:
        find_references(tmp_path, "some-game")
    assert "\n" not in str(caught.value)


def test_a_sound_file_serves_for_a_damaged_one(tmp_path: Path) -> None:
    """Published references and our own may both be there."""
    keep_references(tmp_path / "a", "some-game", dataclasses.asdict(KNOWN)).write_text("{")
    keep_references(tmp_path / "b", "some-game", dataclasses.asdict(KNOWN))
    assert find_references(tmp_path, "some-game") == KNOWN


def test_what_a_newer_program_adds_is_tolerated(tmp_path: Path) -> None:
    """As in `run.json`: unknown keys are no damage, neither in the file nor in a policy."""
    policies = {name: {**dataclasses.asdict(p), "b": 2} for name, p in KNOWN.policies.items()}
    table = {**dataclasses.asdict(KNOWN), "a": 1, "policies": policies}
    keep_references(tmp_path, "some-game", table)
    assert find_references(tmp_path, "some-game") == KNOWN


@pytest.mark.parametrize("name", ["a**b", "[game", "../game"])
def test_a_foreign_game_is_looked_for_by_its_very_name(name: str, tmp_path: Path) -> None:
    """What stands in a stranger's record is no pattern: nothing is found, and nothing fails."""
    keep_references(tmp_path, "some-game", dataclasses.asdict(KNOWN))
    assert find_references(tmp_path, game_key({"name": name})) is None


def test_damage_is_noted_and_made_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line names the file, the policies are played, and the file is whole the next time."""
    run = write_run(tmp_path, "dcc", 1, spec=game(3))
    first = references_of([run], tmp_path)
    [path] = (tmp_path / "references").iterdir()
    path.write_text("{")
    capsys.readouterr()
    assert references_of([run], tmp_path) == first
    [noted] = [line for line in capsys.readouterr().err.splitlines() if str(path) in line]
    assert "is damaged" in noted
    assert find_references(tmp_path, game_key(game(3)["environment"])) == first[path.stem]


@pytest.mark.parametrize("place", ["published/study", "runs"])
def test_nothing_is_kept_in_a_run_or_in_what_is_published(place: str, tmp_path: Path) -> None:
    """Whoever looks at one run makes them for its results folder, where they are found again."""
    run = write_run(tmp_path / "made", "dcc", 1, spec=game(3))
    study = tmp_path / place
    there = study / "pursuit-n6" / run.path.name
    there.parent.mkdir(parents=True)
    run.path.rename(there)
    (study / "TABLES.md").touch()
    before = sorted(study.rglob("*"))
    first = references_of([run], there)
    assert sorted(study.rglob("*")) == before
    [path] = (tmp_path / "references").iterdir()
    path.write_text(path.read_text().replace("200", "7", 1))  # that it is read the next time
    assert references_of([run], there) != first
