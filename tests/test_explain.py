"""`explain` says of every name what stands where it is defined, and nothing that is not so."""

import json
import re
from dataclasses import asdict
from pathlib import Path
from typing import get_args

import pytest

from msgdrop_cli.analysis.verdict import Word
from msgdrop_cli.app import COMMANDS
from msgdrop_cli.commands import explain
from msgdrop_cli.commands.parts import console
from msgdrop_cli.commands.parts.topics import topics
from msgdrop_cli.commands.parts.topics.question_keys import question_keys
from msgdrop_cli.definition.figures import all_figures
from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.pages import METRICS, page, rows
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.readings import all_readings
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.messages.encoders import encoders
from msgdrop_cli.messages.topologies import topologies
from msgdrop_cli.report.page.content import MEANINGS
from msgdrop_envs import registry
from tests.cli_runs import msgdrop

KNOWN = catalogue()
TOPICS = topics()
QUESTIONS = [load_definition(name) for name in list_definitions()]
NAMES = {
    "algorithm": [*KNOWN.algorithms],
    "game": [*KNOWN.environments],
    "channel": [*KNOWN.channels],
    "topology": [*topologies()],
    "encoder": [*encoders()],
    "question": list_definitions(),
    "figure": [*all_figures()],
    "reading": [*all_readings()],
    "verdict": [*get_args(Word)],
    "profile": [name for each in QUESTIONS for name in each.profiles],
    "variant": [name for each in QUESTIONS for name in each.variants],
}


@pytest.fixture(autouse=True)
def read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything is read from the sources once, not for every name."""
    monkeypatch.setattr(explain, "topics", lambda: TOPICS)


def told(name: str) -> str:
    """What is said of a name, in one line."""
    said = msgdrop("explain", name)
    assert said.code == 0, said.err
    return " ".join(said.out.split())


def without_marks(text: str) -> str:
    """A question's file in which nothing is left out any more."""
    return re.sub(r"^#(?! )", "", text, flags=re.MULTILINE)


@pytest.mark.parametrize("kind", NAMES)
def test_everything_with_a_name_is_explained(kind: str) -> None:
    """Whatever the registries find stands in the list, and has a text."""
    listed = json.loads(msgdrop("explain", "--json").out)
    assert set(NAMES[kind]) <= set(listed[kind])
    for name in NAMES[kind]:
        topics = json.loads(msgdrop("explain", name, "--json").out)
        assert all(topic["text"] for topic in topics if topic["kind"] == kind)
        assert kind in [topic["kind"] for topic in topics]


def test_a_reading_is_explained_by_its_row_of_the_paper() -> None:
    """What the paper says, how it is read by default, and what the reading sets instead."""
    said = told("far-sight")
    assert "far-sight: reading, --reading far-sight Others are seen up to 1.0." in said
    assert "sets environment.sight=1.0 the paper says others only if the distance" in said
    assert "read by default D = 0.5, a fifth of the area" in said
    assert "pay once, as in MADRL. games" in told("capture-once")
    assert "evaluates at epsilon 0.02" in told("exploring")


def test_a_figure_is_explained_by_its_part_of_a_question() -> None:
    """Its games and claims, not all of the question's, and what to ask it with."""
    said = told("figure-4b")
    assert "a part of dropout-rate: msgdrop ablate figure-4b" in said
    assert "games pursuit-n8 channels" in said
    assert "profiles quick, million, two-million, paper" in said
    assert "variant md-0.2 DCC-MD 0.2" in said


def test_a_verdict_is_explained_in_the_words_of_the_page() -> None:
    """Those of `msgdrop reproduce`, read without loading them."""
    for word, meaning in MEANINGS.items():
        assert told(word).lower() == f"{word}: verdict, what is said of a claim {meaning}.".lower()


def test_every_name_of_the_page_of_metrics_is_explained() -> None:
    """Once, by the game's formula or in the page's words."""
    named = [name for cells in rows(page(METRICS)) for name in re.findall("`(.*?)`", cells[0])]
    assert {"loss", "wall_time_s", "catches_per_500"} <= set(named)
    for name in named:
        topics = json.loads(msgdrop("explain", name, "--json").out)
        assert {"metric"} <= {topic["kind"] for topic in topics}
    assert "loss: metric, in logs and tables Means over updates" in told("loss")
    assert "in logs" not in told("catches_per_500")


def test_variants_and_profiles_are_explained_question_by_question() -> None:
    """What an arm changes, and how much a scale trains."""
    assert "in broken-links name=dcc-md, rate=0.5" in told("md-0.5")
    assert "of dropout-rate seeds=2, evaluation_episodes=200" in told("quick")


@pytest.mark.parametrize("typed", ["not run", "not-run", "Not_Run"])
def test_a_word_may_be_spelled_as_it_is_met(typed: str) -> None:
    """In tables, in JSON, at the beginning of a sentence."""
    assert told(typed) == told("not run")


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("message dropout", "message-dropout: word"),
        ("broken links", "broken-links: question"),
        ("alpha spent", "registration.alpha_spent: key"),
        ("Holm", "family or holm: word, docs/verdicts.md The claims of one game"),
        ("family", "judged together"),
        ("look", "look: word, docs/verdicts.md A number of seeds at which"),
        ("seed", "Arms of one seed meet the same games"),
        ("margin", "registration.margin: key"),
        ("checkpoint", "Exact resume"),
        ("cohort", "Which runs train stacked"),
    ],
)
def test_words_of_the_program_are_explained(typed: str, said: str) -> None:
    """Several typed without quotes are one name; each is told from the page that defines it."""
    found = msgdrop("explain", *typed.split())
    assert (found.code, said in " ".join(found.out.split())) == (0, True), found


def test_every_command_is_explained_and_points_to_its_help() -> None:
    """`msgdrop explain ablate` is what a newcomer types first."""
    for name in COMMANDS:
        assert f"{name}: command, msgdrop {name} --help" in told(name)


def test_a_learner_is_explained_with_its_settings_and_the_paper() -> None:
    """The values are those that the name has, the lines of the paper stay."""
    assert "rate=0.2 Probability of dropping a message (or an element)" in told("dcc-md")
    assert "in training (paper l. 173)." in told("dcc-md")
    assert "dcc.py with dropout=element, drops_own=true" in told("full-sd")
    assert "rate=0.0 Probability" in told("dcc")


def test_a_game_is_explained_with_its_rules_metrics_and_sizes() -> None:
    """The rule book, and what else belongs to this name."""
    said = told("pursuit-n8")
    assert "map_size=17 Cells on a side of the map (paper l. 373)." in said
    assert "The game ends when no evader is left." in said
    assert "for dcc f_units=[64, 48], g_units=128" in said


def test_a_name_of_several_things_means_all_of_them() -> None:
    """Of a path the last part will do."""
    assert told("algorithm.rate") == told("rate")
    assert "dropping a message" in told("rate")
    assert "dropping another agent's observation" in told("rate")
    assert ("all: topology" in told("all"), "all: channel" in told("all")) == (True, True)


def test_a_setting_has_the_value_of_each_name_and_size() -> None:
    """And the choices, where there are some."""
    assert "default 0.2 fdc 0.0 dcc 0.0 concat-dcc 0.0" in told("rate")
    assert "dcc in pursuit-n8 128" in told("g_units")
    assert "one of message, element" in told("dropout")
    assert "maddpg in waterworld-n8 2000000" in told("train_env_steps")


@pytest.mark.parametrize("name", KNOWN.environments)
def test_metrics_are_those_of_the_game(name: str) -> None:
    """The formula that is read from the source is that of the loaded game."""
    for metric, formula in registry.make(name).metrics.items():
        said, parts = told(metric), asdict(formula)
        assert parts["meaning"] in said
        ratio = f"{parts['scale']:g} x {parts['count']} / {parts['per']}".removeprefix("1 x ")
        assert f"({ratio}; {parts['better']} is better)" in said


def test_the_file_of_a_question_can_be_asked(tmp_path: Path) -> None:
    """As it is printed, and with every key that may be left out."""
    file, whole = msgdrop("explain", "toml").out, tmp_path / "whole.toml"
    (tmp_path / "mine.toml").write_text(file)
    assert len(plan(load_definition(str(tmp_path / "mine.toml")), "quick", KNOWN).runs) == 2
    other = '[variants.dcc]\nlabel = "DCC"\nalgorithm = { name = "dcc" }\n'
    whole.write_text(f"{without_marks(file)}\n{other}")
    asked = plan(load_definition(str(whole)), "quick", KNOWN)
    assert len(asked.runs) == 4
    assert len(asked.claims) == 1
    assert asked.evaluation_episodes == 200


def refused(text: str, tmp_path: Path) -> set[str]:
    """The keys that the loader says it takes where it finds another one."""
    (tmp_path / "wrong.toml").write_text(text)
    with pytest.raises(DefinitionError, match=r"unknown key; known: (.*)") as caught:
        load_definition(str(tmp_path / "wrong.toml"))
    return set(str(caught.value).partition("known: ")[2].split(", "))


@pytest.mark.parametrize("table", ["", "variants", "profiles", "claims"])
def test_the_keys_of_a_question_are_those_that_the_loader_takes(table: str, tmp_path: Path) -> None:
    """In each of its tables: no more, and none less."""
    keys, file = list(question_keys()), without_marks(msgdrop("explain", "toml").out)
    head = next((key.example for key in keys if key.is_table and key.names == (table,)), "")
    wrong = file.replace(head, f"{head}\nqqqqq = 1", 1) if table else f"qqqqq = 1\n{file}"
    inside = [key for key in keys if key.table == table]
    assert refused(wrong, tmp_path) == {name for key in inside for name in key.names}
    assert all(key.meaning in told(path) for key in inside for path in key.paths)


def test_texts_are_as_wide_as_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Paragraphs and points are broken between words, nothing is lost, and points stay points."""
    wide = msgdrop("explain", "waterworld-n8").out
    monkeypatch.setattr(console, "_PIPED_WIDTH", 50)
    narrow = msgdrop("explain", "waterworld-n8").out
    text, _, _ = narrow.partition("\npursuers=8")
    assert max(map(len, text.splitlines())) <= 50
    assert text.split() == wide.partition("\npursuers=8")[0].split()
    assert len(re.findall(r"^\d\. ", text, re.MULTILINE)) == 5
    assert re.search(r"^   [a-z]", text, re.MULTILINE)


def test_an_unknown_name_is_told_the_nearest() -> None:
    """In one line; where none is near, how to see them all."""
    said = msgdrop("explain", "ratee")
    assert (said.code, said.out) == (2, "")
    assert said.err.endswith("nothing is called 'ratee'; did you mean 'rate' or 'trace'?\n")
    said = msgdrop("explain", "x" * 900)
    assert said.err.endswith("; msgdrop explain lists what there is\n")
    assert len(said.err.splitlines()) == 1
