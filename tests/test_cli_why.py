"""`status --why`: what keeps runs from being finished and up to date, and what to type."""

import json
import shlex
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.commands.parts import why
from msgdrop_cli.commands.parts.options import TrainOptions
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.readings import all_readings, apart, under
from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.definition.spec import Definition, PlannedRun
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.records.files import run_lock
from msgdrop_cli.records.planned import plan_run
from msgdrop_cli.records.store import RunRecord, list_runs, run_path
from tests.cli_runs import QUESTION, ROOT, msgdrop
from tests.runs import foreign_run

PUBLISHED = ROOT / "results" / "published"


@cache
def _published() -> RunRecord:
    [folder] = PUBLISHED.glob("broken-links-two-million/pursuit-n6/dcc-s1-*")
    [record] = list_runs(folder)
    return record


def published(**changes: Any) -> RunRecord:
    """A published run of DCC with broken links; changes: keys of its `run.json`."""
    return RunRecord(_published().path, _published().run | changes)


def only(*records: RunRecord) -> why.Why:
    """The one reason for all of them."""
    [found] = why.reasons(records, catalogue())
    return found


def test_a_finished_run_needs_no_reason() -> None:
    """What is published is what its questions ask for today."""
    assert why.reasons([published()], catalogue()) == []


@pytest.mark.parametrize(
    ("status", "says"),
    [
        ("planned", "not begun"),
        ("interrupted", "checkpoint"),
        ("failed", "no disk; tried again"),
        ("running", "nobody works at it"),
    ],
)
def test_an_unfinished_run_says_what_finishes_it(status: str, says: str) -> None:
    """The command asks for this question, profile and seed only."""
    found = only(published(status=status, reason="no disk"))
    assert found.word == {"running": "killed"}.get(status, status)
    assert says in found.reason
    assert found.command == "msgdrop ablate broken-links --profile two-million --seed 1"


def test_a_run_at_work_needs_no_reason(tmp_path: Path) -> None:
    """Whoever holds its lock will end it."""
    record = RunRecord(tmp_path / "run", published(status="running").run)
    with run_lock(record.path):
        assert why.reasons([record], catalogue()) == []
    found = only(record)
    assert found.word == "killed"
    assert found.command.endswith(f"--seed 1 --results {tmp_path / 'run'}")


def test_a_diverged_run_is_not_tried_again() -> None:
    """It would diverge again; nothing is to be typed."""
    found = only(published(status="diverged", reason="NaN"))
    assert found.reason == "NaN; it would diverge again, and counts as the worst value"
    assert found.command == ""


def test_runs_of_one_question_stand_together() -> None:
    """One command is enough for all their seeds."""
    found = only(*(published(status="planned", seed=seed) for seed in (3, 1)))
    assert len(found.records) == 2
    assert found.command.endswith("--seeds 1,3")


def _with_gamma(record: RunRecord) -> dict[str, Any]:
    spec = record.spec | {"algorithm": record.spec["algorithm"] | {"gamma": 0.5}}
    return {"spec": spec, "run_id": "0badf00d"}


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        (_with_gamma, "settings have changed: algorithm.gamma 0.5 -> 0.99"),
        (lambda _: {"profile": "billion"}, "no profile of broken-links.toml is called 'billion'"),
        (lambda _: {"variant": "md-7"}, "no such variant or game any more"),
        (lambda _: {"registration": "broken-links:00000000"}, "another registration"),
    ],
)
def test_a_stale_run_says_what_changed(
    changed: Callable[[RunRecord], dict[str, Any]], says: str
) -> None:
    """A finished run that its question would not train today is told apart."""
    found = only(published(**changed(published())))
    assert found.word == "stale"
    assert says in found.reason


def test_missing_evaluations_are_named(tmp_path: Path) -> None:
    """A run that was not played through all channels is incomplete."""
    record = published()
    found = only(RunRecord(tmp_path, record.run))  # no episodes there
    assert (found.word, found.reason) == (
        "incomplete",
        "fewer than 1,000 episodes through none, half, all",
    )


def test_questions_of_ones_own_are_named_as_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which file it was is not recorded; its name is, and where such files lie."""
    monkeypatch.chdir(tmp_path)
    record = published(status="planned", definition="mine")
    found = only(record)
    assert found.command.startswith("msgdrop ablate PATH/mine.toml ")
    assert found.lacks == "PATH, the folder of mine.toml: no record has it"
    (tmp_path / "ablations").mkdir()
    (tmp_path / "ablations" / "mine.toml").touch()
    found = only(record)
    assert found.command.startswith("msgdrop ablate ablations/mine.toml ")
    assert found.lacks == ""


@pytest.mark.parametrize(
    "typed",
    [
        "--env navigation-n8 --algorithm dcc --profile quick --steps 2000 --seeds 2,3",
        "--profile quick --set training.train_env_steps=3000 --seed 1",
        "--rate 0.3 --profile million --set algorithm.f_units=[8,8] --seed 1",
        "--profile paper --set environment.capture_reward_once=true --seed 5",
        "--channel delay:2 --profile quick --seed 1",
    ],
)
def test_the_command_of_train_plans_the_same_runs(
    typed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its record has every setting, so it can be typed."""
    monkeypatch.chdir(tmp_path)
    asked = planned_by(monkeypatch, ["train", *typed.split()])
    for run in asked:
        plan_run(run_path(Path("results"), run), run)
    found = only(*list_runs(Path("results")))
    again = planned_by(monkeypatch, shlex.split(found.command)[1:])
    assert [run.run_id for run in again] == [run.run_id for run in asked]


def planned_by(monkeypatch: pytest.MonkeyPatch, arguments: Sequence[str]) -> Sequence[PlannedRun]:
    """What a command line would train."""
    found: list[PlannedRun] = []

    def planned(question: Definition, given: TrainOptions) -> int:
        changes, seeds = given.overrides, given.seeds
        found.extend(
            plan(question, given.profile, catalogue(), overrides=changes, seeds=seeds).runs
        )
        return 0

    monkeypatch.setattr("msgdrop_cli.commands.parts.carry_out.carry_out", planned)
    assert msgdrop(*arguments).code == 0
    return found


def test_a_train_stands_by_itself() -> None:
    """One command cannot ask for two games or algorithms, as that of a question does."""
    arms = [
        published(status="planned", definition="train", variant=name) for name in ("dcc", "fdc")
    ]
    found = why.reasons(arms, catalogue())
    assert ["--algorithm dcc" in each.command for each in found] == [True, False]


def test_readings_are_asked_for_again() -> None:
    """A word of profile and readings is taken apart; what they set is not set twice."""
    [(section, key)] = [
        (section, key)
        for section in ("algorithm", "training", "environment")
        for key in getattr(all_readings()["capture-once"], section)
    ]
    overrides = [f"{section}.{key}=1", "algorithm.gamma=0.5"]
    found = only(published(status="planned", profile="quick-capture-once", overrides=overrides))
    assert (
        "--profile quick --reading capture-once --set algorithm.gamma=0.5 --seed 1" in found.command
    )


def test_readings_of_an_own_question_are_asked_for_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As long as its file is there, which knows what its profiles are called."""
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(QUESTION)
    run = published(status="planned", definition="mine", profile="quick-huber")
    assert "ablate mine.toml --profile quick --reading huber --seed 1" in only(run).command
    Path("mine.toml").write_text("none")
    assert "ablate mine.toml --profile quick-huber" in only(run).command


@pytest.mark.parametrize(
    "reading", [name for name, each in all_readings().items() if not each.evaluation_epsilon]
)
def test_a_profiles_name_is_taken_apart_again(reading: str) -> None:
    """`apart` undoes `under`, for one reading and for two."""
    known = all_readings()
    other = next(name for name in known if name != reading and not known[name].evaluation_epsilon)
    for readings in ((), (reading,), tuple(sorted((reading, other)))):
        assert apart(under("two-million", readings), ["two", "two-million"]) == (
            "two-million",
            readings,
        )
    assert apart("two-millions", ["two-million"]) == ("two-millions", ())


def test_the_command_shows_it() -> None:
    """Words for people, and the same for programs."""
    said = msgdrop("status", PUBLISHED / "navigation-half-million", "--why")
    assert said.out == "6 runs, own and published: finished and up to date, or at work\n"
    assert (
        json.loads(msgdrop("status", PUBLISHED / "navigation-half-million", "--why", "--json").out)
        == []
    )


def test_why_says_how_long_it_takes_as_the_plan_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same time, with the same assumption, as the command that it says to type."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1, 2, 3})
    arguments = ("broken-links", "--profile", "two-million", "--seeds", "3,4")
    asked = plan(load_definition("broken-links"), "two-million", catalogue(), seeds=(3, 4))
    for run in asked.runs:
        plan_run(run_path(Path("results"), run), run)
    [why_not] = json.loads(msgdrop("status", "results", "--why", "--json").out)
    said = " ".join(msgdrop("ablate", *arguments, "--dry-run").out.split())
    assert why_not["status"] == "planned"
    assert why_not["time"].startswith("about ")
    assert why_not["time"].endswith("if 2 cores are free)")
    assert f"time {why_not['time']}" in said


def test_what_nobody_has_asked_for_is_shown_without_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """No factory that a record names is called for an estimate; what is unknown is none, either."""
    run = foreign_run("Push")
    monkeypatch.delenv("MSGDROP_FACTORIES")
    theirs = spec_to_dict(run.spec)
    unknown = _published().spec | {"algorithm": {"learner": "nobody"}}
    for number, spec in enumerate((theirs, unknown)):
        record = published(status="planned", spec=spec, run_id=f"0000000{number}")
        found = why.reasons([record], catalogue())
        assert [each.word for each in found] == ["planned"]
        assert why.times(found, [record], catalogue()) == [""]
