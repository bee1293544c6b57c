"""Reference policies on their way from the game to tables, figures and published folders."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.analysis.summary import Summary, summarise
from msgdrop_cli.commands.references import references_of
from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.engine.references import play_references
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.references import (
    Policy,
    References,
    find_references,
    game_key,
    keep_references,
)
from msgdrop_cli.report.figures import draw_broken_links, draw_learning
from msgdrop_cli.report.table import broken_links_table, results_table
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
    assert broken_links_table(found, GROUP).rows[1] == ("(random)", "\u2013", "0.50", "0.50")


@pytest.mark.parametrize("draw", [draw_learning, draw_broken_links])
def test_figures_draw_what_is_near_and_tell_what_is_far(tmp_path: Path, draw: object) -> None:
    """A dotted line at 0.5 beside its name; 62 would flatten the curves and stands below."""
    assert callable(draw)
    figure = draw(summary(tmp_path), GROUP)
    axes = figure.axes[0]
    dotted = [line for line in axes.lines if list(line.get_ydata()) == [0.5, 0.5]]
    assert len(dotted) == 1
    assert "(random)" in [text.get_text() for text in axes.texts]
    footer = " ".join(figure.texts[0].get_text().split())
    assert "policies that learn nothing, 200 episodes each. Not drawn: (scripted) 62." in footer
    assert axes.get_ylim()[1] < 10


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
    monkeypatch.setattr("msgdrop_cli.engine.references.play_references", None)
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


def test_damage_is_one_line(tmp_path: Path) -> None:
    """A file that does not say what it should names itself and what to do."""
    path = keep_references(tmp_path, "some-game", dataclasses.asdict(KNOWN))
    assert find_references(tmp_path, "some-game") == KNOWN
    path.write_text(json.dumps({"episodes": "many"}))
    with pytest.raises(RecordError, match=r"some-game\.json.*delete it") as caught:
        find_references(tmp_path, "some-game")
    assert "\n" not in str(caught.value)
