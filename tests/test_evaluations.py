"""Equally many episodes of everything that is compared, and words where some were left out."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from msgdrop_cli.analysis.summary import Summary, summarise
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.report.table import channels_table, results_table
from tests.fake_runs import GROUP, write_arm, write_run

HEADLINE = "catches_per_500"


def played(
    root: Path, variant: str, catches: Mapping[float, Sequence[int]], seed: int = 1
) -> RunRecord:
    """A run whose episodes of 500 steps have so many catches, fraction by fraction."""
    record = write_run(root, variant, seed)
    rows = [
        {"broken_links": links, "episode": number, "steps": 500, "catches": count,
         "finished": False, "return": 0.0}
        for links, counts in catches.items() for number, count in enumerate(counts)
    ]  # fmt: skip
    text = "".join(json.dumps(row) + "\n" for row in reversed(rows))  # their numbers count
    (record.path / "episodes.jsonl").write_text(text)
    return record


def shown(summary: Summary) -> dict[tuple[str, float], tuple[float, int]]:
    """(variant, broken links) to the headline's mean and its episodes."""
    return {
        (arm.variant, row.channel.settings[0]): (row.mean, row.episodes)
        for arm in summary.arms
        for row in arm.rows
        if row.metric == HEADLINE
    }


def test_the_first_episodes_count_where_a_number_is_asked_for(tmp_path: Path) -> None:
    """Two of each channel, however many were played, in the order of their numbers."""
    record = played(tmp_path, "dcc", {0.0: [1, 3, 80, 80], 0.3: [0, 1], 0.5: [2, 2, 70]})
    assert shown(summarise([record], episodes=2)) == {
        ("dcc", 0.0): (2.0, 2),
        ("dcc", 0.3): (0.5, 2),
        ("dcc", 0.5): (2.0, 2),
    }


def test_a_channel_with_fewer_episodes_is_left_out_and_counted(tmp_path: Path) -> None:
    """One of three asked for is no number that stands beside the others."""
    summary = summarise([played(tmp_path, "dcc", {0.0: [1, 2, 3, 9], 0.3: [7]})], episodes=3)
    assert shown(summary) == {("dcc", 0.0): (2.0, 3)}
    assert summary.left_out == 1


def test_without_a_number_as_many_count_as_all_have(tmp_path: Path) -> None:
    """The run with the fewest episodes, two, says how many of each: variants and seeds alike."""
    records = [
        played(tmp_path, "dcc", {0.0: [1, 3, 80], 0.5: [1, 1, 90]}),
        played(tmp_path, "md-0.2", {0.0: [4, 6]}),
        played(tmp_path, "md-0.2", {0.0: [5, 5, 5, 70]}, seed=2),
    ]
    assert shown(summarise(records)) == {
        ("dcc", 0.0): (2.0, 2),
        ("dcc", 0.5): (1.0, 2),
        ("md-0.2", 0.0): (5.0, 2),
    }


def test_a_short_look_at_broken_links_takes_nothing_from_the_whole_ones(tmp_path: Path) -> None:
    """One episode with half of the links broken is left out; the three whole ones stay."""
    summary = summarise([played(tmp_path, "dcc", {0.0: [1, 2, 3], 0.5: [9]})])
    assert shown(summary) == {("dcc", 0.0): (2.0, 3)}
    assert summary.left_out == 1


def test_groups_are_counted_apart(tmp_path: Path) -> None:
    """What is never compared needs no equal number."""
    quick = played(tmp_path, "dcc", {0.0: [1]})
    paper = played(tmp_path, "md-0.2", {0.0: [2, 4]})
    paper.run["profile"] = "paper"
    assert shown(summarise([quick, paper])) == {("dcc", 0.0): (1, 1), ("md-0.2", 0.0): (3.0, 2)}


def test_captions_say_that_only_the_first_episodes_count(tmp_path: Path) -> None:
    """Both tables; and they say it only where there are more."""
    record = played(tmp_path, "dcc", {0.0: [1, 3, 80], 0.3: [0, 1]})
    cut = summarise([record], episodes=2)
    part = "1,000 env steps a run; the first 2 "
    assert f"{part}greedy evaluation episodes per seed" in results_table(cut, GROUP).caption
    assert f"{part}evaluation episodes per seed." in channels_table(cut, GROUP).caption
    # Of 0.3 nobody has played more; but of the columns beside it somebody has.
    assert "the first" not in results_table(cut, GROUP, Channel.read(0.3)).caption
    whole = summarise([played(tmp_path, "md-0.2", {0.0: [1, 3], 0.3: [0, 1]})])
    for table in (results_table(whole, GROUP), channels_table(whole, GROUP)):
        assert "the first" not in table.caption


@pytest.mark.parametrize("returns", [(1e308, 1e308), (1e308, -1e308), (1e101, -1e101)])
def test_what_cannot_be_added_up_names_its_log(
    tmp_path: Path, returns: tuple[float, float]
) -> None:
    """Neither the sum nor its error is infinite in anybody's table."""
    record = played(tmp_path, "dcc", {0.0: [1, 2]})
    log = record.path / "episodes.jsonl"
    rows = [json.loads(line) for line in log.read_text().splitlines()]
    changed = [row | {"return": value} for row, value in zip(rows, returns, strict=True)]
    log.write_text("".join(json.dumps(row) + "\n" for row in changed))
    with pytest.raises(RecordError, match=f"{log}: an episode's row is not readable"):
        summarise([record])


def test_the_seeds_beside_a_number_are_those_in_it(tmp_path: Path) -> None:
    """A run that is trained and not evaluated is in no mean of evaluations."""
    runs = [*write_arm(tmp_path, "dcc", [3, 4]), write_run(tmp_path, "dcc", 3)]
    summary = summarise(runs)
    assert results_table(summary, GROUP).rows[0][1] == "2 (1 not evaluated)"
    assert channels_table(summary, GROUP).rows[0][1] == "2 (1 not evaluated)"
