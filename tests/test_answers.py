"""Which runs answer a shipped question: those that it plans, whatever they are called."""

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.analysis.curves import smooth_curve
from msgdrop_cli.analysis.summary import Summary, summarise
from msgdrop_cli.commands.parts.answers import Answers, find_answers
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.records.store import RunRecord
from tests.answering_runs import write_answers
from tests.fake_runs import write_run

OFFERS = catalogue()


@pytest.fixture(autouse=True)
def no_references(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody plays reference policies here."""
    place = "msgdrop_cli.commands.parts.answers.references_of"
    monkeypatch.setattr(place, lambda records, root: {})


def answers(root: Path, *questions: str) -> Answers:
    """What a results folder answers of some questions."""
    return find_answers(root, [load_definition(name) for name in questions], OFFERS)


def arms(found: Answers, number: int = 0) -> dict[tuple[str, str], int]:
    """Finished runs of one question by variant and profile."""
    summary = found.answers[number].summary
    return {(arm.variant, arm.group.profile): len(arm.done) for arm in summary.arms}


def test_a_run_answers_every_question_that_plans_it(tmp_path: Path) -> None:
    """By its id: two questions share FDC, DCC and MD 0.2, each by its own labels."""
    write_answers(tmp_path)
    found = answers(tmp_path, "architecture", "dropout-rate")
    assert arms(found, 0) == {("dcc", "quick"): 2, ("md-0.2", "quick"): 2}
    assert arms(found, 1).keys() == {(v, "quick") for v in ("dcc", "md-0.2", "md-0.5", "fdc")}
    labels = [[arm.label for arm in each.summary.arms] for each in found.answers]
    assert labels[0] == ["DCC f/g/h", "DCC-MD 0.2 f/g/h"]
    assert labels[1][:2] == ["DCC", "DCC-MD 0.2"]
    assert found.others == ()


def test_a_run_with_the_name_alone_answers_nothing(tmp_path: Path) -> None:
    """Somebody's own `dcc` of a quick profile is in no claim, and is told of."""
    write_run(tmp_path, "dcc", 1, catches={0.0: 3}, definition="broken-links")
    found = answers(tmp_path, "broken-links")
    assert arms(found) == {}
    assert [record.variant for record in found.others] == ["dcc"]


def test_runs_under_a_reading_are_found_by_it(tmp_path: Path) -> None:
    """They stand beside the default ones, not among them."""
    write_answers(tmp_path)
    write_answers(tmp_path, readings=("capture-once", "huber"))
    found = answers(tmp_path, "broken-links")
    profiles = {profile for _, profile in arms(found)}
    assert profiles == {"quick", "quick-capture-once-huber"}
    assert found.scales["quick-capture-once-huber"].readings == ("capture-once", "huber")


def test_a_damaged_record_is_told_and_the_others_count(tmp_path: Path) -> None:
    """Unlike other commands, which refuse: a page of all there is must say what is not."""
    first, *_ = write_answers(tmp_path)
    (first / "run.json").write_text("{")
    found = answers(tmp_path, "broken-links")
    assert [each.path for each in found.unreadable] == [first]
    assert arms(found)["fdc", "quick"] == 1


@pytest.mark.parametrize("log", ["episodes.jsonl", "metrics.jsonl"])
def test_a_damaged_log_takes_its_run_out(tmp_path: Path, log: str) -> None:
    """And no other, and it is no run of no claim either."""
    first, *_ = write_answers(tmp_path)
    (first / log).write_text('{"broken_links": 0.0, "episode": "x", "env_steps": 0}\n')
    found = answers(tmp_path, "broken-links")
    assert [each.path for each in found.unreadable] == [first]
    assert log in found.unreadable[0].reason
    assert arms(found)["fdc", "quick"] == 1
    assert found.others == ()


def test_a_log_is_read_once(tmp_path: Path) -> None:
    """However many claims and figures look at it."""
    write_answers(tmp_path)
    [record, *_] = answers(tmp_path, "broken-links").records
    curve = smooth_curve(record, "catches_per_500")
    (record.path / "metrics.jsonl").unlink()
    assert smooth_curve(record, "catches_per_500") == curve
    assert curve.values


def as_published(root: Path, study: str) -> Path:
    """Publish the own runs of a results folder; returns DCC's of seed 1."""
    shutil.copytree(root / "runs", root / "published" / study)
    return next((root / "published" / study).glob("*/dcc-s1-*"))


def test_a_sound_copy_counts_for_a_damaged_one(tmp_path: Path) -> None:
    """Which is told of, and is among no copies."""
    write_answers(tmp_path)
    damaged = as_published(tmp_path, "broken-links-quick") / "episodes.jsonl"
    sound = as_published(tmp_path, "other-quick")
    record = sound / "run.json"
    record.write_text(record.read_text().replace('"broken-links"', '"other"'))
    shutil.rmtree(tmp_path / "runs")
    damaged.write_text("{\n")
    found = answers(tmp_path, "broken-links")
    assert [each.path for each in found.unreadable] == [damaged.parent]
    assert arms(found)["dcc", "quick"] == 2
    [counted] = found.copies[sound.name.rpartition("-")[2]]
    assert counted.path == sound


def test_every_copy_of_a_run_is_there_once(tmp_path: Path) -> None:
    """Also the one that counts."""
    write_answers(tmp_path)
    as_published(tmp_path, "broken-links-quick")
    for copies in answers(tmp_path, "broken-links").copies.values():
        assert [record.is_own for record in copies] == [False, True]


def test_thousands_of_runs_load_no_definition_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each run is looked at alone before all are summed up: for damage, and once."""
    write_answers(tmp_path)
    counted: list[int] = []

    def noted(records: Sequence[RunRecord], **options: Any) -> Summary:
        counted.append(len(records))
        return summarise(records, **options)

    monkeypatch.setattr("msgdrop_cli.commands.parts.answers.summarise", noted)
    found = answers(tmp_path, "broken-links")
    assert counted == [len(found.records)]
