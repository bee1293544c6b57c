"""Other readings of the paper: named in one place, asked of any question, and told apart."""

import json
import re
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest

from benchmarks import campaign
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.readings import all_readings, held_by, readings_of
from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.definition.spec import Definition, Variant
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.store import list_runs
from tests.cli_runs import QUESTION, filled_store, msgdrop

CATALOGUE = catalogue()
READINGS = all_readings()
QUESTIONS = {name: load_definition(name) for name in list_definitions()}
PAGE = (Path(__file__).parents[1] / "PAPER.md").read_text()
SECTIONS = ("algorithm", "training", "environment")


def refused(question: Definition, *readings: str) -> str:
    """The message with which a question is not asked under these readings."""
    with pytest.raises(DefinitionError) as caught:
        plan(question, "quick", CATALOGUE, readings=readings)
    return str(caught.value)


@pytest.mark.parametrize(
    ("name", "question"),
    [
        (n, q)
        for n, q in product(READINGS, QUESTIONS)
        if n in readings_of(QUESTIONS[q].environments)
    ],
)
def test_a_reading_changes_its_own_settings_of_every_run(name: str, question: str) -> None:
    """Those that it names and no others, whatever the variant; so every run is another one."""
    asked = QUESTIONS[question]
    usual, read = (plan(asked, "paper", CATALOGUE, readings=r).runs for r in ((), (name,)))
    for before, after in zip(usual, read, strict=True):
        tables = spec_to_dict(before.spec), spec_to_dict(after.spec)
        for section in SECTIONS:
            old, new = (table[section] for table in tables)
            changed = {key: value for key, value in new.items() if old.get(key) != value}
            assert changed == getattr(READINGS[name], section)
        changes_runs = not READINGS[name].evaluation_epsilon
        assert (before.run_id != after.run_id) == changes_runs
        assert after.profile == (f"paper-{name}" if changes_runs else "paper")


@pytest.mark.parametrize("name", READINGS)
def test_a_reading_belongs_to_a_row_of_the_page(name: str) -> None:
    """One row of PAPER.md begins as the reading says, and names it."""
    reading = READINGS[name]
    [row] = [line for line in PAGE.splitlines() if line.startswith(f"| {reading.row}")]
    assert re.search(rf"; readings? .*`{name}`", row)
    assert set(reading.environments) <= set(CATALOGUE.environments)
    assert readings_of(reading.environments)[name] == reading


def test_a_reading_that_is_a_profile_too_finds_its_runs() -> None:
    """`--profile million --reading nearest` of navigation is what `million-nearest` has trained."""
    asked = QUESTIONS["navigation"]
    read = plan(asked, "million", CATALOGUE, readings=("nearest",))
    profile = plan(asked, "million-nearest", CATALOGUE)
    assert [run.run_id for run in read.runs] == [run.run_id for run in profile.runs]
    assert read.profile == profile.profile


def test_the_order_of_readings_does_not_matter() -> None:
    """Two of them are one set of runs, called alike."""
    plans = [
        plan(QUESTIONS["broken-links"], "quick", CATALOGUE, readings=names)
        for names in (("huber", "capture-once"), ("capture-once", "huber"))
    ]
    assert [run.run_id for run in plans[0].runs] == [run.run_id for run in plans[1].runs]
    assert {each.profile for each in plans} == {"quick-capture-once-huber"}


def test_policies_that_explore_are_evaluated_beside_greedy_ones(tmp_path: Path) -> None:
    """The same runs, another evaluation of each channel, which the claims are about."""
    links = QUESTIONS["broken-links"]
    usual, read = (plan(links, "paper", CATALOGUE, readings=r) for r in ((), ("exploring",)))
    keys = [channel.key for channel in usual.channels]
    assert [channel.key for channel in read.channels] == [
        *keys, *(f"{key}+epsilon:0.02" for key in keys)
    ]  # fmt: skip
    asked = [(claim.channel.key, claim.measure) for claim in usual.claims]
    assert [(c.channel.key, c.measure) for c in read.claims] == [
        (f"{key}+epsilon:0.02", measure) for key, measure in asked
    ]
    store = filled_store(tmp_path)
    said = store.ablate("--reading", "exploring")
    assert said.code == 0, said.err
    assert "trained" not in said.err
    assert "none broken, epsilon 0.02" in " ".join(said.out.split())
    assert "figures/tiny-quick-exploring/" in said.out
    for record in list_runs(store.results):
        assert {each.key for each in record.episodes()} >= {"links:0", "links:0+epsilon:0.02"}
    assert "epsilon" not in store.ablate().out


def test_who_explores_already_is_not_evaluated_twice() -> None:
    """A question may ask for exploration itself; its claims stay about what they say."""
    links = QUESTIONS["broken-links"]
    own = tuple(map(Channel.read, ("none", "half+epsilon:0.1", "none+epsilon:0.02")))
    claims = [replace(links.claims[0], channel=channel) for channel in own[:2]]
    asked = replace(links, channels=own, claims=tuple(claims))
    read = plan(asked, "paper", CATALOGUE, readings=("exploring",))
    assert read.channels == own
    assert [c.channel for c in read.definition.claims] == [own[2], own[1]]


def test_what_is_typed_lies_over_a_reading() -> None:
    """`--set` is the last word."""
    asked = plan(
        QUESTIONS["navigation"],
        "quick",
        CATALOGUE,
        readings=("far-sight",),
        overrides=("environment.sight=0.8",),
    )
    assert {run.spec.environment_config.sight for run in asked.runs} == {0.8}


def test_readings_that_cannot_be_meant_are_refused() -> None:
    """One line that says why."""
    links, navigation = QUESTIONS["broken-links"], QUESTIONS["navigation"]
    assert "did you mean 'capture-once'" in refused(links, "capture-one")
    assert "huber is given twice" in refused(links, "huber", "huber")
    assert "not in pursuit-n6" in refused(links, "nearest")
    assert "near-sight and --reading far-sight" in refused(navigation, "far-sight", "near-sight")
    several = ("absolute-locations", "collision-once", "long-navigation", "nearest")
    assert "ask under fewer" in refused(navigation, *several, "huber", "batch-128")


def test_what_a_variant_sets_itself_no_reading_changes() -> None:
    """It would be another variant under its old name."""
    question = QUESTIONS["broken-links"]
    own = Variant(label="Own", algorithm={"name": "dcc", "loss": "mse"})
    message = refused(replace(question, variants={**question.variants, "own": own}), "huber")
    assert message.startswith("--reading huber: algorithm.loss: variant own sets this itself")


def test_what_a_reading_gave_is_told_apart_wherever_it_is_shown(tmp_path: Path) -> None:
    """Table, verdict, figure, status and evaluation name it; claims are judged for each apart."""
    store = filled_store(tmp_path)
    said = store.ablate("--reading", "capture-once")
    assert said.code == 0, said.err
    assert "two evaders captured in one step pay once" in said.err
    words = " ".join(said.out.split())
    assert "(quick-capture-once, overridden)" in words
    assert "pursuit-n6, 200 env steps, quick-capture-once" in words
    assert "tiny-quick-capture-once/" in words
    listed = json.loads(msgdrop("status", store.results, "--json").out)
    profiles = ["quick", "quick-capture-once"]
    assert sorted(line["profile"] for line in listed) == sorted(profiles * 4)
    document = json.loads(msgdrop("unstable-test", store.results, "--episodes", "4", "--json").out)
    arms = {(row["profile"], row["label"]) for row in document["results"]}
    assert arms == set(product(profiles, ("DCC [/red]", "DCC-MD 0.2")))
    judged = [claim["group"]["profile"] for claim in document["claims"]]
    assert sorted(set(judged)) == profiles
    assert not any("set-ups" in claim["reason"] for claim in document["claims"])


def test_a_campaign_trains_under_a_reading(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another machine's runs come home with its name, and `ablate` finds them."""
    monkeypatch.setenv("MSGDROP_COMMIT", "0123456789" * 4)
    question, results = tmp_path / "tiny.toml", tmp_path / "results"
    question.write_text(QUESTION)
    asked = ("--profile", "quick", "--reading", "no-sharing", "--seeds", "1", "--workers", "1")
    out = tmp_path / "out"
    assert campaign.main([str(question), *asked, "--out", str(out), "--minutes", "1"]) == 0
    assert msgdrop("import", *out.glob("*.zip"), "--results", results).code == 0
    assert {record.profile for record in list_runs(results)} == {"quick-no-sharing"}
    said = msgdrop("ablate", question, *asked, "--results", results, "--dry-run")
    assert "2 runs: 2 finished" in " ".join(said.out.split())


def test_a_run_holds_no_reading_of_its_evaluation() -> None:
    """What is only asked of evaluations changes no run, so no run is one under it."""
    asked = plan(load_definition("broken-links"), "quick", catalogue(), seeds=(1,))
    for run in asked.runs:
        assert held_by(spec_to_dict(run.spec), "pursuit-n6") == ()


def test_readings_are_listed() -> None:
    """With what they say: in the help, and below the questions."""
    for arguments in (["ablate", "--help"], ["ablate"]):
        shown = " ".join(msgdrop(*arguments).out.split())
        assert all(f"{name} {each.says}" in shown for name, each in READINGS.items())
