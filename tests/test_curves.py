"""Learning curves over the seeds of an arm."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from msgdrop_cli.analysis.curves import learning_curve, learning_mean
from msgdrop_cli.errors import RecordError
from tests.fake_runs import write_run

HEADLINE = "catches_per_500"


def test_curve_of_two_seeds_spans_both(tmp_path: Path) -> None:
    """Mean in the middle, band from the lower to the higher seed; four windows are not smoothed."""
    records = [
        write_run(tmp_path, "dcc", 1, curve=[0.0, 2.0, 4.0, 6.0]),
        write_run(tmp_path, "dcc", 2, curve=[2.0, 2.0, 8.0, 6.0]),
    ]
    curve = learning_curve(records, HEADLINE)
    assert curve is not None
    assert curve.env_steps == [250, 500, 750, 1000]
    assert curve.mean == [1.0, 2.0, 6.0, 6.0]
    assert curve.band == [(0.0, 2.0), (2.0, 2.0), (4.0, 8.0), (6.0, 6.0)]


def test_curve_of_one_seed_has_no_band(tmp_path: Path) -> None:
    """One seed has no spread to draw."""
    curve = learning_curve([write_run(tmp_path, "dcc", 1)], HEADLINE)
    assert curve is not None
    assert curve.band is None


def test_smoothing_is_a_centred_mean_of_a_twentieth(tmp_path: Path) -> None:
    """Of 100 windows 5 are averaged, 3 at the very ends; a lone 1 becomes 5 times 0.2."""
    values = [0.0] * 100
    values[50], values[0] = 1.0, 3.0
    record = write_run(tmp_path, "dcc", 1, curve=values)
    curve = learning_curve([record], HEADLINE)
    assert curve is not None
    assert curve.mean[47:54] == pytest.approx([0.0, 0.2, 0.2, 0.2, 0.2, 0.2, 0.0])
    assert curve.mean[:4] == pytest.approx([1.0, 0.75, 0.6, 0.0])


def test_curve_keeps_the_steps_that_all_seeds_have(tmp_path: Path) -> None:
    """A window without a value in one seed is no point of the mean."""
    records = [
        write_run(tmp_path, "dcc", 1, curve=[None, 2.0, 4.0, 6.0]),
        write_run(tmp_path, "dcc", 2, curve=[2.0, 2.0, None, 6.0]),
    ]
    curve = learning_curve(records, HEADLINE)
    assert curve is not None
    assert curve.env_steps == [500, 1000]


def test_no_log_no_curve(tmp_path: Path) -> None:
    """A run that has none yet has neither curve nor mean of one; a finished one has lost it."""
    record = write_run(tmp_path, "dcc", 1, curve=[], status="interrupted")
    assert learning_curve([record], HEADLINE) is None
    assert learning_mean(record, HEADLINE) is None
    with pytest.raises(RecordError, match=r"metrics\.jsonl: does not end with env_steps 1000"):
        learning_curve([write_run(tmp_path, "fdc", 1, curve=[])], HEADLINE)


@pytest.mark.parametrize(
    "lost", [slice(1), slice(1, 2), slice(3, None)], ids=["first", "one", "last"]
)
def test_a_log_that_has_lost_rows_is_refused(tmp_path: Path, lost: slice) -> None:
    """Of a finished run, wherever they were: the mean of what is left is another number."""
    record = write_run(tmp_path, "dcc", 1)
    log = record.path / "metrics.jsonl"
    rows = log.read_text().splitlines(keepends=True)
    del rows[lost]
    log.write_text("".join(rows))
    with pytest.raises(RecordError, match=r"metrics\.jsonl: (env_steps|does not end with)"):
        learning_mean(record, HEADLINE)


def test_learning_mean_weighs_windows_by_their_length(tmp_path: Path) -> None:
    """A last window of a tenth counts a tenth: (900 * 1 + 100 * 11) / 1000."""
    record = write_run(tmp_path, "dcc", 1, curve=[1.0])
    rows = [{"env_steps": 900, HEADLINE: 1.0}, {"env_steps": 1000, HEADLINE: 11.0}]
    (record.path / "metrics.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert learning_mean(replace(record), HEADLINE) == 2.0


def test_a_log_that_goes_back_is_refused(tmp_path: Path) -> None:
    """Duplicated windows, as after a bad resume, are named and not averaged."""
    record = write_run(tmp_path, "dcc", 1)
    log = record.path / "metrics.jsonl"
    log.write_text(log.read_text() * 2)
    with pytest.raises(RecordError, match=r"metrics\.jsonl: env_steps 250 does not follow 1000"):
        learning_mean(record, HEADLINE)
