"""The error of one seed's number, over its episodes, apart from how far seeds lie apart."""

import random
from pathlib import Path
from statistics import fmean, stdev

import pytest

from msgdrop_cli.analysis.metrics import NamedMetric, metrics_of
from msgdrop_cli.analysis.statistics import root_mean_square
from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.report.table import results_table
from tests.fake_runs import GROUP, write_arm, write_run


def metric(folder: Path, name: str) -> NamedMetric:
    """A formula of pursuit."""
    found = metrics_of(write_run(folder, "dcc", 1)).find(name)
    assert found is not None
    return found


def played(rng: random.Random, count: int) -> list[dict[str, float]]:
    """Episodes that end with the second catch, at most after 500 steps."""
    ended = [rng.randint(50, 800) for _ in range(count)]
    return [{"steps": min(500, each), "catches": 2 if each < 500 else 1} for each in ended]


def test_per_episode_it_is_the_standard_error_of_the_mean(tmp_path: Path) -> None:
    """Three episodes, by pencil: catches 1, 2, 6 have a standard deviation of sqrt(7)."""
    rows = [{"catches": count} for count in (1, 2, 6)]
    error = metric(tmp_path, "catches_per_episode").standard_error(rows)
    assert error == pytest.approx(stdev([1, 2, 6]) / 3**0.5)
    assert error == pytest.approx((7 / 3) ** 0.5)


def test_of_a_ratio_it_is_what_the_ratio_varies_by(tmp_path: Path) -> None:
    """400 evaluations of 200 episodes: their standard deviation, and the mean of their errors."""
    rng, rate = random.Random(1), metric(tmp_path, "catches_per_500")
    evaluations = [played(rng, 200) for _ in range(400)]
    errors = [rate.standard_error(rows) for rows in evaluations]
    spread = stdev(rate.value(rows) for rows in evaluations)
    assert fmean(each for each in errors if each) == pytest.approx(spread, rel=0.1)
    naive = stdev(500 * row["catches"] / row["steps"] for row in evaluations[0]) / 200**0.5
    assert abs(naive - spread) > 0.05 * spread  # a mean of ratios is something else


def test_four_times_the_episodes_halve_it(tmp_path: Path) -> None:
    """1,000 and 4,000 episodes."""
    rate, rows = metric(tmp_path, "catches_per_500"), played(random.Random(2), 4_000)
    few, many = rate.standard_error(rows[:1_000]), rate.standard_error(rows)
    assert few is not None
    assert many == pytest.approx(few / 2.0, rel=0.1)


def test_one_episode_has_none(tmp_path: Path) -> None:
    """Nor has a mean of seeds of which one has a single episode."""
    rate = metric(tmp_path, "catches_per_500")
    assert rate.standard_error([{"steps": 500, "catches": 3}]) is None
    assert root_mean_square([1.0, None]) is None
    assert root_mean_square([3.0, 4.0]) == pytest.approx(12.5**0.5)


def test_it_stands_apart_from_the_spread_of_seeds(tmp_path: Path) -> None:
    """In rows, in JSON and in the table: c catches of 500 steps, all in one of two episodes."""
    summary = summarise(write_arm(tmp_path, "dcc", [4, 1, 2, 9]))
    [row] = [each for each in summary.arms[0].rows if each.metric == "catches_per_500"]
    assert row.between == pytest.approx(stdev([4, 1, 2, 9]))
    assert row.within == pytest.approx(fmean(c * c for c in (4, 1, 2, 9)) ** 0.5)
    [line] = [each for each in summary.to_json() if each["metric"] == "catches_per_500"]
    assert (line["within_seed"], line["between_seeds"]) == (row.within, row.between)
    table = results_table(summary, GROUP)
    place = table.headers.index("error in a seed, spread of seeds")
    assert table.rows[0][place] == "5.05, 3.56"
    assert all(len(cells) == len(table.headers) for cells in table.rows)
    assert "that error included" in table.caption
