"""`msgdrop reproduce --train`: what open claims lack, every variant's seed 1 first."""

import shutil
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from msgdrop_cli.analysis.reproduction import reproduce
from msgdrop_cli.commands import reproduce as reproduce_command
from msgdrop_cli.commands.parts import paper_page
from msgdrop_cli.commands.parts.answers import find_answers, whole
from msgdrop_cli.commands.parts.estimate import cohorts, estimate, finished_runs
from msgdrop_cli.commands.parts.survey import Wanted, survey, wanted_of
from msgdrop_cli.commands.parts.train_missing import Means, breadth_first, seconds, train_missing
from msgdrop_cli.commands.parts.ways import wanted_runs, with_ways
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.definition.figures import all_figures
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.store import list_runs
from tests.answering_runs import write_answers
from tests.cli_runs import ROOT, msgdrop

OFFERS = catalogue()
HALF = Channel.read(0.5)


@pytest.fixture(autouse=True)
def no_references(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody plays reference policies here."""
    place = "msgdrop_cli.commands.parts.answers.references_of"
    monkeypatch.setattr(place, lambda records, root: {})


def wanted(*channels: Channel, seeds: int = 3, episodes: int = 10) -> list[Wanted]:
    """The runs of a question, variant by variant."""
    asked = plan(load_definition("broken-links"), "quick", OFFERS, seeds=range(1, seeds + 1))
    return [Wanted(run=run, channels=channels, episodes=episodes) for run in asked.runs]


def test_every_variant_gets_seed_1_before_any_gets_seed_2() -> None:
    """So a study that is cut short is balanced; of one seed nobody changes the order."""
    ordered = [(each.run.spec.seed, each.run.variant) for each in breadth_first(wanted())]
    assert ordered == [
        (seed, variant) for seed in (1, 2, 3) for variant in ("fdc", "dcc", "md-0.2", "md-0.5")
    ]


def test_a_run_that_two_claims_want_is_one() -> None:
    """Evaluated with the channels of both, in as many episodes as either wants."""
    both = breadth_first([*wanted(NONE_BROKEN), *wanted(HALF, NONE_BROKEN, episodes=20)])
    assert len(both) == 12
    assert {(each.channels, each.episodes) for each in both} == {((NONE_BROKEN, HALF), 20)}


def test_what_is_wanted_is_what_the_next_look_lacks(tmp_path: Path) -> None:
    """At the scale that is there, for arms of open claims: seeds 3 to 10 where two are done."""
    write_answers(tmp_path)
    answers = find_answers(tmp_path, [load_definition("broken-links")], OFFERS)
    found = breadth_first(wanted_runs(reproduce(answers.answers, all_figures()), answers, OFFERS))
    own = [each.run for each in found if each.run.spec.environment == "pursuit-n6"]
    assert {(run.variant, run.spec.seed) for run in own} == {
        (variant, seed) for variant in ("fdc", "dcc", "md-0.2", "md-0.5") for seed in range(3, 11)
    }
    assert {run.profile for run in own} == {"quick"}
    assert not {run.run_id for run in own} & {record.run_id for record in list_runs(tmp_path)}
    others = {each.run.spec.seed for each in found} - {run.spec.seed for run in own}
    assert others == {1, 2}  # of pursuit-n8, of which nothing is there
    assert all(len(each.channels) == 3 for each in found)


def test_what_is_published_without_an_evaluation_is_wanted(tmp_path: Path) -> None:
    """A run with neither as many episodes as are asked for nor a policy is not there."""
    question = load_definition("broken-links")
    write_answers(tmp_path)  # two episodes each
    (tmp_path / "runs").rename(tmp_path / "published")
    for folder in (tmp_path / "published").glob("*/*-s1-*"):
        (folder / "policy.safetensors").write_bytes(b"?")
    answers = find_answers(tmp_path, [question], OFFERS)
    found = wanted_runs(reproduce(answers.answers, all_figures()), answers, OFFERS)
    md = [each.run for each in found if each.run.variant == "md-0.2"]
    seeds = {run.spec.seed for run in md if run.spec.environment == "pursuit-n6"}
    assert seeds == set(range(2, 11))


def test_a_damaged_published_log_costs_only_its_run(tmp_path: Path) -> None:
    """It is wanted again, like one that is nowhere, and what the others cost is told."""
    question = load_definition("broken-links")
    write_answers(tmp_path)
    (tmp_path / "runs").rename(tmp_path / "published")
    [damaged] = tmp_path.glob("published/pursuit-n6/dcc-s1-*/episodes.jsonl")
    for policy in tmp_path.glob("published/*/*"):
        (policy / "policy.safetensors").write_bytes(b"?")
    damaged.write_text("{\n")
    answers = find_answers(tmp_path, [question], OFFERS)
    found = wanted_runs(reproduce(answers.answers, all_figures()), answers, OFFERS)
    runs = {each.run.run_id for each in found if each.run.variant == "dcc"}
    assert damaged.parent.name.rpartition("-")[2] in runs


def test_a_claim_whose_look_has_come_waits_for_its_family() -> None:
    """More seeds of its own arms would decide nothing: rates 0.1, 0.3, 0.4 with ten seeds do."""
    published = ROOT / "results" / "published" / "broken-links-two-million"
    answers = find_answers(published, [load_definition("dropout-rate")], OFFERS)
    sections = with_ways(
        reproduce(answers.answers, all_figures()), answers, OFFERS, workers=1, device="cpu"
    )
    lines = [line for section in sections for line in section.lines]
    [line] = [
        each
        for each in lines
        if (each.better, each.worse, each.environment) == ("md-0.2", "fdc", "pursuit-n6")
        and each.measure == "evaluation"
    ]
    assert line.word == "undecided"
    assert line.decides is not None
    assert (line.decides.family, line.decides.seeds, line.decides.runs) == (True, 10, 30)
    runs = breadth_first(wanted_runs(sections, answers, OFFERS))
    own = [each.run for each in runs if each.run.spec.environment == "pursuit-n6"]
    assert {run.variant for run in own} == {"md-0.1", "md-0.3", "md-0.4"}
    assert {run.spec.seed for run in own} == set(range(1, 11))


@pytest.mark.slow
def test_the_budget_is_kept_and_the_page_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever is at work when it is spent has a checkpoint, and no failure.

    What the page takes of it is another test's: on a busy machine three seconds and more.
    """
    train = paper_page.train

    def whole_budget(folder: Path, means: Means) -> int:
        return train(folder, replace(means, ends=time.monotonic() + 3.0))

    monkeypatch.setattr(paper_page, "list_definitions", lambda: ["architecture"])
    monkeypatch.setattr(paper_page, "train", whole_budget)
    folder = tmp_path / "results"
    said = msgdrop("reproduce", folder, "--train", "--budget", "3s", "--workers", "1")
    assert said.code == 0, said.err
    assert "the time is up; the same command goes on" in said.err
    assert {record.seed for record in list_runs(folder)} == {1}
    assert {record.status for record in list_runs(folder)} == {"interrupted"}
    assert (folder / "reproduce.html").is_file()


def test_the_page_is_a_part_of_the_budget(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Made before, which takes 40 s here, and after: of five minutes 260 s are left to train."""
    clock, asked = [1000.0], list[Means]()

    def written(folder: Path, workers: int, device: str, *, may_be_empty: bool) -> None:
        clock[0] += 40.0

    monkeypatch.setattr(reproduce_command, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    monkeypatch.setattr(reproduce_command, "_written", written)
    monkeypatch.setattr(paper_page, "train", lambda folder, means: asked.append(means))
    reproduce_command._train(tmp_path, "5min", 1, "cpu")
    assert asked[0].ends == 1000.0 + 300.0 - 40.0


def test_a_budget_that_the_page_takes_trains_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It says so, and no run is begun."""
    over = Means(workers=1, device="cpu", ends=time.monotonic())
    assert train_missing(wanted(NONE_BROKEN), [], tmp_path, over) == 0
    assert "the page alone takes all of the --budget" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("text", "expected"), [("6h", 21600.0), ("90min", 5400.0), ("1.5s", 1.5)])
def test_a_budget_is_a_time(text: str, expected: float) -> None:
    """In hours, minutes or seconds."""
    assert seconds(text) == expected


@pytest.mark.parametrize("text", ["", "6", "h", "-1h", "0s", "1e9h", "6 hours"])
def test_what_is_no_time_is_refused(text: str) -> None:
    """With examples."""
    with pytest.raises(DefinitionError, match="expected a time"):
        seconds(text)


def test_a_budget_without_training_is_refused(tmp_path: Path) -> None:
    """Nobody waits six hours for nothing."""
    said = msgdrop("reproduce", tmp_path, "--budget", "6h")
    assert said.code == 2
    assert "--train" in said.err


def test_the_page_says_the_time_of_the_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What would decide a claim, all arms of its family, takes as long as `ablate` says of them."""
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1, 2, 3})
    folder = shutil.copytree(
        ROOT / "results" / "published" / "navigation-half-million",
        tmp_path / "published" / "navigation-half-million",
    )
    answers = find_answers(folder, [load_definition("navigation")], OFFERS)
    sections = with_ways(
        reproduce(answers.answers, all_figures()), answers, OFFERS, workers=2, device="cpu"
    )
    [line] = [
        line
        for section in sections
        for line in section.lines
        if (line.better, line.worse) == ("md-0.2", "dcc")
        and (line.environment, line.measure) == ("navigation-n8", "evaluation")
    ]
    assert line.decides is not None
    seeds = range(1, line.decides.seeds + 1)
    asked = plan(whole(load_definition("navigation")), "half-million", OFFERS, seeds=seeds)
    family = [run for run in asked.runs if run.spec.environment == "navigation-n8"]
    looked_up = survey(wanted_of(asked, family), tmp_path)
    told = estimate(
        looked_up,
        cohorts(looked_up.pending, "cpu"),
        finished_runs(tmp_path),
        workers=2,
        device="cpu",
        episodes=asked.evaluation_episodes,
        evaluations=len(asked.channels),
    )
    assert line.decides.runs == len(looked_up.pending) == 34
    assert line.decides.seconds == pytest.approx(told.seconds)
    assert line.decides.source == told.source
    assert told.source.endswith("if 2 cores are free")
