"""How long training takes here: learnt from what worked alike, or a rule of thumb."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.commands.parts import paces
from msgdrop_cli.commands.parts.paces import Paces, Took
from msgdrop_cli.commands.parts.shapes import run_sizes
from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine import facts
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.records.store import RunRecord, list_runs
from msgdrop_cli.records.times import cpu_time_s
from tests import runs as tiny
from tests.test_cli_estimate import planned

ALIKE = {"device": "cpu", "kernel": "c-dcc", "host": facts.host()}


def finished(place: Path, run: PlannedRun, **changes: Any) -> RunRecord:
    """A run of the same work, 480 env steps in 10 s by the clock."""
    table = {"spec": spec_to_dict(run.spec), "env_steps": 480, "wall_time_s": 10.0}
    return RunRecord(place / "pursuit-n6" / "dcc-s1-01234567", {**table, **ALIKE, **changes})


def of(run: PlannedRun, *records: RunRecord, workers: int = 1, machine: int = 8) -> Paces:
    """What is known of its speed."""
    return Paces(records, workers=workers, device="cpu", machine=machine)


@pytest.mark.parametrize(
    ("made_by", "speeds"),
    [
        ({}, [48.0]),
        ({"kernel": "c-sparse"}, []),
        ({"kernel": None}, []),
        ({"host": "aarch64 DEFAULT"}, []),
        ({"device": "cuda"}, []),
    ],
)
def test_speed_is_learnt_from_what_worked_alike(
    made_by: dict[str, str | None], speeds: list[float], tmp_path: Path
) -> None:
    """Another machine's run, or one of an older kernel, says nothing about this one."""
    run = tiny.planned()
    took = of(run, finished(tmp_path, run, **made_by))._took(run, "c-dcc")
    assert [each.env_steps_per_s for each in took] == speeds


def test_the_rule_of_thumb_is_near_what_was_measured() -> None:
    """Env steps per second of benchmarks/NOTES.md within a factor of two, in C and in torch."""
    for environment, algorithm, kernel, measured in (
        ("pursuit-n6", "dcc-md", "c-dcc", 5_887),
        ("pursuit-n8", "dcc-md", "c-dcc", 3_010),
        ("navigation-n8", "fdc", "c-dcc", 9_864),
        ("navigation-n8", "dcc-md", "c-dcc", 5_625),
        ("waterworld-n8", "maddpg-md", "c-sparse-rows", 1_500),
        ("pursuit-n6", "dcc-md", "torch-autograd", 1_474),
    ):
        sizes = run_sizes(planned(environment, algorithm), episodes=8)
        speed = paces.rule_of_thumb(replace(sizes, kernel=kernel))
        assert measured / 2 < speed < 2 * measured, (environment, algorithm, speed)


def test_own_runs_say_more_of_this_machine_than_published_ones(tmp_path: Path) -> None:
    """A host is a kind of processor only; published runs may come from another, idler one."""
    run = tiny.planned()
    published = finished(tmp_path / "published" / "a-quick", run)
    own = finished(tmp_path / "runs", run, wall_time_s=40.0)
    assert of(run, published, own)._took(run, "c-dcc") == [Took(12.0, True, False)]
    assert of(run, published)._took(run, "c-dcc") == [Took(48.0, False, False)]


def test_an_own_run_without_a_speed_hides_no_published_one(tmp_path: Path) -> None:
    """One of less than a second says nothing."""
    run = tiny.planned()
    published = finished(tmp_path / "published" / "a-quick", run)
    short = finished(tmp_path / "runs", run, wall_time_s=0.5)
    assert of(run, published, short)._took(run, "c-dcc") == [Took(48.0, False, False)]


@pytest.mark.parametrize(
    ("speeds", "expected"),
    [
        ([], (1_000.0, 500.0, 2_000.0)),
        ([100.0], (100.0, 80.0, 125.0)),
        ([50.0, 100.0, 300.0], (100.0, 50.0, 300.0)),
    ],
)
def test_a_range_is_what_was_measured_or_what_the_rule_is_good_for(
    speeds: list[float], expected: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Likely, slowest, fastest: a factor of two, a quarter either way, or the spread if wider."""
    monkeypatch.setattr(paces, "rule_of_thumb", lambda sizes: 1_000.0)
    sizes = run_sizes(planned("pursuit-n6", "dcc"), episodes=8)
    assert paces.pace_of(speeds, sizes) == expected


def test_a_processors_time_says_more_than_the_clock(tmp_path: Path) -> None:
    """Twice as long by the clock was a machine at work at something else."""
    run = tiny.planned()
    loaded = finished(tmp_path / "runs", run, wall_time_s=20.0, cpu_time_s=8.0)
    older = finished(tmp_path / "runs", run, wall_time_s=40.0)
    assert of(run, loaded, older)._took(run, "c-dcc") == [Took(60.0, True, True)]
    assert of(run, older)._took(run, "c-dcc") == [Took(12.0, True, False)]


@pytest.mark.parametrize("value", [None, "8", float("nan"), -1.0, 10**400])
def test_what_is_no_time_counts_as_none(value: object, tmp_path: Path) -> None:
    """Records may come from anybody."""
    record = finished(tmp_path / "runs", tiny.planned(), cpu_time_s=value)
    assert cpu_time_s(record) is None


def test_training_records_its_processor_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Through a stop and what comes after it; not of a run that an older program began."""
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
    run = tiny.planned()
    train_cohort([run], tmp_path, stop=tiny.StopAt(30))
    [record] = list_runs(tmp_path)
    before = cpu_time_s(record)
    assert before is not None
    train_cohort([run], tmp_path)
    [record] = list_runs(tmp_path)
    assert record.status == "done"
    assert (cpu_time_s(record) or 0.0) > before > 0.0
    other = tiny.planned(seed=2)
    train_cohort([other], tmp_path, stop=tiny.StopAt(30))
    [file] = tmp_path.rglob("*-s2-*/run.json")
    table = json.loads(file.read_text())
    del table["cpu_time_s"]
    file.write_text(json.dumps(table))
    train_cohort([other], tmp_path)
    assert "cpu_time_s" not in json.loads(file.read_text())


@pytest.mark.parametrize(
    ("workers", "machine", "seconds", "says"),
    [
        (1, 8, 30.0, "if 1 core is free"),
        (2, 8, 20.0, "if 2 cores are free"),
        (8, 2, 20.0, "if 2 cores are free"),
        (8, 8, 10.0, "if 3 cores are free"),
    ],
)
def test_workers_are_worth_the_cores_that_there_are(
    workers: int, machine: int, seconds: float, says: str, tmp_path: Path
) -> None:
    """Three runs of ten seconds each."""
    run = tiny.planned()
    kernel = run_sizes(run, 1).kernel
    known = of(
        run, finished(tmp_path / "runs", run, kernel=kernel), workers=workers, machine=machine
    )
    spent, source = known.of([[(run, 480)]] * 3)
    assert spent.likely == pytest.approx(seconds)
    assert source == f"time, load included, of your finished runs like these; {says}"


def test_nothing_to_train_takes_no_time() -> None:
    """And assumes nothing."""
    spent, source = Paces([], workers=2, device="cpu").of([])
    assert (spent, source) == ((0.0, 0.0, 0.0), "nothing to train")
