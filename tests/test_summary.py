"""Runs sorted into arms and measured: what may stand in one row, and what its numbers are."""

import json
from pathlib import Path

import pytest

from msgdrop_cli.analysis.metrics import UNKNOWN, metrics_of
from msgdrop_cli.analysis.summary import Group, summarise
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.store import RunRecord
from tests.fake_runs import GROUP, write_arm, write_run

HEADLINE = "catches_per_500"


def test_metrics_of_pursuit(tmp_path: Path) -> None:
    """Each metric is a ratio of sums: 500 * 3 / 600 catches, not a mean of the episodes' ratios."""
    episodes = [
        {"steps": 100, "catches": 2, "finished": True, "return": 4.0},
        {"steps": 500, "catches": 1, "finished": False, "return": -20.0},
    ]
    metrics = metrics_of(write_run(tmp_path, "dcc", 1))
    assert {metric.name: metric.value(episodes) for metric in metrics.all} == {
        "catches_per_500": 2.5,
        "catches_per_episode": 1.5,
        "capture_rate": 0.5,
        "steps_to_finish": 300.0,
        "return_per_episode": -8.0,
    }
    assert metrics.headline.formula == "500 x catches / steps (evader catches in 500 env steps)"


def test_formulas_come_from_the_record(tmp_path: Path) -> None:
    """A new environment brings its own metrics along; analysis needs no edit."""
    tags = {"count": "tags", "per": "episodes", "scale": 1.0, "better": "lower", "meaning": "tags"}
    record = write_run(tmp_path, "dcc", 1, environment="tag-n3", metrics={"tags": tags})
    assert metrics_of(record).headline.value([{"tags": 3}, {"tags": 1}]) == 2.0


def test_a_run_that_never_began_has_no_formulas(tmp_path: Path) -> None:
    """A planned run is listed, not an error."""
    assert metrics_of(write_run(tmp_path, "dcc", 1, metrics={})) is UNKNOWN


def test_damaged_formulas_are_a_record_error(tmp_path: Path) -> None:
    """The message names the file and the key."""
    record = write_run(tmp_path, "dcc", 1, metrics={"tags": {"count": 3}})
    with pytest.raises(RecordError, match=r"run\.json: metrics\.tags"):
        metrics_of(record)


def test_row_of_an_arm(tmp_path: Path) -> None:
    """Per-seed values, mean, IQM, interval and episodes stand in the row."""
    (arm,) = summarise(write_arm(tmp_path, "dcc", [4, 1, 2, 9])).arms
    row = arm.row(HEADLINE)
    assert row is not None
    assert row.by_seed == {1: 4.0, 2: 1.0, 3: 2.0, 4: 9.0}
    assert (row.mean, row.iqm, row.episodes) == (4.0, 3.0, 2)
    assert (row.interval, row.iqm_interval) == ((1.0, 9.0), None)  # lowest to highest


def test_each_broken_links_has_its_rows(tmp_path: Path) -> None:
    """Channels are never averaged with each other."""
    (arm,) = summarise([write_run(tmp_path, "dcc", 1, catches={0.0: 8, 0.5: 4, 1.0: 1})]).arms
    means = {row.channel.word: row.mean for row in arm.rows if row.metric == HEADLINE}
    assert means == {"none": 8.0, "half": 4.0, "all": 1.0}


@pytest.mark.parametrize(
    "other",
    [
        {"train_env_steps": 2000},
        {"profile": "paper"},
        {"algorithm": {"gamma": 0.9}},
        {"environment": "pursuit-n8"},
    ],
)
def test_different_set_ups_never_share_a_row(tmp_path: Path, other: dict[str, object]) -> None:
    """The same variant name at another length, profile, override or environment is another arm."""
    records = write_arm(tmp_path, "dcc", [1, 1])
    records.append(write_run(tmp_path, "dcc", 3, catches={0.0: 9}, **other))  # type: ignore[arg-type]  # keys and values go together
    assert sorted(len(arm.done) for arm in summarise(records).arms) == [1, 2]


def test_set_ups_in_one_group_are_told_apart_by_their_label(tmp_path: Path) -> None:
    """Two rows of one variant name the field that differs."""
    records = [write_run(tmp_path, "dcc", 1, algorithm={"gamma": gamma}) for gamma in (0.9, 0.99)]
    labels = [arm.label for arm in summarise(records).arms]
    assert labels == ["DCC (gamma=0.9)", "DCC (gamma=0.99)"]


def test_cosmetic_fields_do_not_split_an_arm(tmp_path: Path) -> None:
    """How often checkpoints are written cannot change a result."""
    one, two = write_arm(tmp_path, "dcc", [1, 2])
    two.run["spec"]["training"]["checkpoint_every_env_steps"] = 5
    (arm,) = summarise([one, two]).arms
    assert len(arm.done) == 2


@pytest.mark.parametrize("status", ["planned", "running", "interrupted", "failed", "diverged"])
def test_only_done_runs_are_measured(tmp_path: Path, status: str) -> None:
    """A run that is not done is counted beside the row, not in it."""
    records = write_arm(tmp_path, "dcc", [5, 7])
    records.append(write_run(tmp_path, "dcc", 3, catches={0.0: 100}, status=status))
    (arm,) = summarise(records).arms
    row = arm.row(HEADLINE)
    assert row is not None
    assert row.mean == 6.0
    counts = {"failed": arm.failed, "diverged": arm.diverged}
    assert counts.get(status, arm.unfinished) == 1
    assert (len(arm.done), arm.failed + arm.diverged + arm.unfinished) == (2, 1)


def test_an_arm_that_only_failed_is_still_there(tmp_path: Path) -> None:
    """A variant whose every run diverged is reported, not forgotten."""
    (arm,) = summarise(write_arm(tmp_path, "full-sd", [1, 1], status="diverged")).arms
    assert (arm.diverged, arm.rows) == (2, ())


def test_a_run_that_is_there_twice_counts_once(tmp_path: Path) -> None:
    """The published copy of a local run adds nothing; of two copies the finished one counts."""
    local = write_run(tmp_path / "local", "dcc", 1, status="interrupted")
    published = write_run(tmp_path / "published", "dcc", 1, catches={0.0: 5})
    for records in ([local, published], [published, local]):
        (arm,) = summarise(records).arms
        assert [record.path for record in arm.done] == [published.path]
        assert arm.unfinished == 0


def test_order(tmp_path: Path) -> None:
    """Groups are sorted; in a group the asked order comes first, the rest by name."""
    records = [
        write_run(tmp_path, variant, 1, profile=profile)
        for profile in ("quick", "paper")
        for variant in ("b", "a", "fdc", "dcc")
    ]
    summary = summarise(records, order=("fdc", "dcc"))
    assert [arm.group.profile for arm in summary.arms] == ["paper"] * 4 + ["quick"] * 4
    assert summary.groups == (Group("pursuit-n6", 1000, "paper"), GROUP)
    assert [arm.variant for arm in summary.arms_of(GROUP)] == ["fdc", "dcc", "a", "b"]


def test_the_order_is_that_of_the_definition(tmp_path: Path) -> None:
    """Nobody has to know it: what is drawn from records stands as in the command that made them."""
    records = [
        write_run(tmp_path, variant, 1, definition="blockwise-vs-elementwise")
        for variant in ("another", "fdc", "sd-0.2", "dcc")
    ]
    variants = [arm.variant for arm in summarise(records).arms]
    assert variants == ["dcc", "sd-0.2", "fdc", "another"]


def test_the_order_is_that_of_the_definition_with_most_runs(tmp_path: Path) -> None:
    """Two questions in one group: one order for both, and not by where the runs lie."""
    trained = {"broken-links": ("md-0.5", "dcc", "fdc"), "blockwise-vs-elementwise": ("sd-0.2",)}
    records = [
        write_run(tmp_path, variant, 1, definition=definition)
        for definition, variants in trained.items()
        for variant in variants
    ]
    for mixed in (records, records[::-1]):
        variants = [arm.variant for arm in summarise(mixed).arms]
        assert variants == ["fdc", "dcc", "md-0.5", "sd-0.2"]


def test_intervals_do_not_depend_on_what_else_is_summarised(tmp_path: Path) -> None:
    """An arm has the same numbers alone, in company, and read in another order."""
    records = write_arm(tmp_path, "dcc", [1, 5, 9, 20, 31, 50, 77])
    others = write_arm(tmp_path, "aaa", [2, 3, 4])
    alone = summarise(records).arms[0].rows
    together = summarise([*others, *reversed(records)]).arms[1].rows
    assert alone == together


def test_bootstrap_seed_is_the_callers(tmp_path: Path) -> None:
    """Another seed draws another interval."""
    records = write_arm(tmp_path, "dcc", [1, 5, 9, 20, 31, 50, 77, 80, 90, 120, 200, 310])
    rows = [summarise(records, bootstrap_seed=seed).arms[0].row(HEADLINE) for seed in (1, 2)]
    assert rows[0] is not None
    assert rows[1] is not None
    assert rows[0].interval == rows[1].interval  # of the mean: nothing is drawn
    assert rows[0].iqm_interval != rows[1].iqm_interval


def test_json_is_strict(tmp_path: Path) -> None:
    """One line per arm, links and metric, and one for an arm without numbers; no NaN."""
    records = [write_run(tmp_path, "dcc", 1, catches={0.0: 5})]
    records += write_arm(tmp_path, "full-sd", [1], status="failed")
    lines = summarise(records).to_json()
    assert json.loads(json.dumps(lines, allow_nan=False)) == lines
    assert [(line["variant"], line["seeds"], line["failed"]) for line in lines] == [
        *[("dcc", 1, 0)] * 5,
        ("full-sd", 0, 1),
    ]


@pytest.mark.parametrize(
    "row", ['{"broken_links": 0.0}', '{"broken_links": 0.0, "steps": "x", "catches": 1}']
)
def test_a_damaged_episode_names_its_file(tmp_path: Path, row: str) -> None:
    """A row without the counters is a RecordError with the path, not a traceback."""
    record = write_run(tmp_path, "dcc", 1)
    (record.path / "episodes.jsonl").write_text(row + "\n")
    with pytest.raises(RecordError, match=r"episodes\.jsonl"):
        summarise([record])


def test_a_spec_without_length_names_its_file(tmp_path: Path) -> None:
    """What the groups need is checked where it is read."""
    record = write_run(tmp_path, "dcc", 1)
    broken = RunRecord(record.path, {**record.run, "spec": {"training": {}}})
    with pytest.raises(RecordError, match=r"run\.json: spec needs"):
        summarise([broken])


def test_a_label_says_what_was_overridden(tmp_path: Path) -> None:
    """Once, also where it is what two set-ups of a variant differ in."""
    records = [
        write_run(tmp_path, "dcc", 1, algorithm={"gamma": 0.99}),
        write_run(tmp_path, "dcc", 1, algorithm={"gamma": 0.9}, overrides=["algorithm.gamma=0.9"]),
        write_run(tmp_path, "md-0.2", 1, overrides=["variants.md-0.2.algorithm.rate=0.3"]),
    ]
    labels = [arm.label for arm in summarise(records).arms]
    assert labels == ["DCC (gamma=0.9)", "DCC (gamma=0.99)", "MD-0.2 (rate=0.3)"]


def test_what_was_overridden_of_all_is_said_of_the_group(tmp_path: Path) -> None:
    """No label grows by it; what was overridden of one variant stays in its label."""
    of_all, of_one = "algorithm.gamma=0.9", "variants.md-0.2.algorithm.rate=0.3"
    records = [
        write_run(tmp_path, "dcc", 1, overrides=[of_all]),
        write_run(tmp_path, "md-0.2", 1, overrides=[of_all, of_one]),
    ]
    summary = summarise(records)
    assert summary.overrides_of(GROUP) == (of_all,)
    assert [arm.label for arm in summary.arms] == ["DCC", "MD-0.2 (rate=0.3)"]
    assert summarise(records[1:]).arms[0].label == "MD-0.2 (rate=0.3)"
