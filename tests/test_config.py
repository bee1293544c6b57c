"""`msgdrop config show`: every setting of a run, its value, and where that comes from."""

import json
from typing import Any

import pytest

from msgdrop_cli.commands.parts import vocabulary
from msgdrop_cli.commands.parts.sources import notation
from msgdrop_cli.definition.load import list_definitions
from tests.cli_runs import msgdrop

Row = dict[str, Any]


def shown(*arguments: str) -> dict[str, Row]:
    """What stands in the rows, by setting."""
    said = msgdrop("config", "show", *arguments, "--json")
    assert said.code == 0, said.err
    return {row["setting"]: row for row in json.loads(said.out)}


@pytest.mark.parametrize(
    ("setting", "value", "origin"),
    [
        ("algorithm.rate", "0.5", 'dropout-rate.toml: variants."md-0.5".algorithm'),
        ("training.train_env_steps", "100000", "dropout-rate.toml: profiles.quick.training"),
        ("algorithm.gamma", "0.9", "--set: algorithm"),
        ("environment.capture_reward_once", "true", "--reading capture-once: environment"),
        ("algorithm.g_units", "96", "paper settings of pursuit-n6: algorithm"),
        ("algorithm.batch_size", "32", "default"),
    ],
)
def test_a_value_comes_from_the_last_who_says_it(setting: str, value: str, origin: str) -> None:
    """Each kind of place: variant, profile, --set, --reading, the paper's sizes, nobody."""
    changes = ("--set", "algorithm.gamma=0.9", "--reading", "capture-once")
    row = shown("dropout-rate", "--variant", "md-0.5", *changes)[setting]
    assert (notation(row["value"]), row["origin"]) == (value, origin)


def test_a_game_of_other_people_is_one() -> None:
    """Records call it by another name than who asks for it."""
    game = "tests.somebodys_game:Echo"
    rows = shown("--env", game, "--algorithm", "dcc")
    assert rows["algorithm.f_units"]["origin"] == f"our sizes for {game}: algorithm"


def test_what_an_algorithms_name_means_is_said() -> None:
    """FDC is DCC without messages."""
    assert shown("--algorithm", "fdc")["algorithm.network"]["origin"] == "algorithm fdc"


@pytest.mark.parametrize("name", list_definitions())
def test_what_is_called_a_default_is_one(name: str) -> None:
    """Whoever changes a setting is named, in every question."""
    defaults = {
        (f"{section.name}.{each.key}", each.default)
        for section in vocabulary.sections()
        for each in section.settings
    }
    rows = [row for row in shown(name).values() if row["origin"] == "default"]
    assert {(row["setting"], notation(row["value"])) for row in rows} <= defaults
    assert rows


def test_values_are_those_that_train_would_have() -> None:
    """As `train --set help` shows them, for the same words."""
    words = ("--env", "navigation-n8", "--algorithm", "dcc", "--set", "training.games=4")
    helped = json.loads(msgdrop("train", *words, "--set", "help", "--json").out)
    rows = shown(*words)
    assert {row["setting"]: row["value"] for row in helped} == {
        setting: row["value"] for setting, row in rows.items()
    }


def test_values_are_what_they_are_in_json() -> None:
    """Numbers, truth values and lists, not their notation; so is what differs between two runs."""
    rows = shown("--algorithm", "dcc")
    assert [rows[f"algorithm.{key}"]["value"] for key in ("rate", "batch_size", "f_units")] == [
        0.0, 32, [64, 48],
    ]  # fmt: skip
    assert rows["environment.capture_reward_once"]["value"] is False
    assert rows["training.channel"]["value"] == "links:0"


def test_the_line_of_the_paper_is_named() -> None:
    """As it stands beside the setting."""
    assert shown()["algorithm.rate"]["source"] == "paper l. 173"
    assert shown()["training.games"]["source"] == "ours"


@pytest.mark.parametrize(
    ("setting", "origin", "source"),
    [
        (
            "algorithm.epsilon_anneal_env_steps",
            "ours: half of dropout-rate.toml: profiles.two-million.training",
            "instead of 2000000 (l. 753)",
        ),
        (
            "algorithm.rate",
            'dropout-rate.toml: variants."md-0.5".algorithm',
            "instead of 0.2 (paper l. 173)",
        ),
        ("algorithm.gamma", "--set: algorithm", "instead of 0.99 (l. 753, printed as lambda)"),
    ],
)
def test_a_line_of_the_paper_is_given_for_no_other_value(
    setting: str, origin: str, source: str
) -> None:
    """What a profile, a variant or --set says instead, and what follows from it, is not there."""
    asked = ("--variant", "md-0.5", "--profile", "two-million", "--set", "algorithm.gamma=0.9")
    row = shown("dropout-rate", *asked)[setting]
    assert (row["origin"], row["source"]) == (origin, source)


def test_a_long_training_explores_as_the_paper_says() -> None:
    """Half of it would be longer, so nothing is derived."""
    asked = ("--env", "navigation-n8", "--profile", "million")
    row = shown(*asked)["algorithm.epsilon_anneal_env_steps"]
    assert (row["value"], row["origin"]) == (400_000, "paper settings of navigation-n8: algorithm")


def test_origins_are_shown_when_asked_for() -> None:
    """Otherwise what the settings mean."""
    assert "algorithm.gamma=0.99" in msgdrop("config", "show").out
    assert "Discount." in msgdrop("config", "show").out
    assert "algorithm.batch_size=32" in msgdrop("config", "show", "--origin").out
    assert "default; ours" in msgdrop("config", "show", "--origin").out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("shwo",), "expected show"),
        (("show", "dropout-rate", "--variant", "md-0.45"), "--variant: 'md-0.45' is not asked"),
        (("show", "navigation", "--env", "pursuit-n6"), "--env: 'pursuit-n6' is not asked"),
        (("show", "navigation", "--algorithm", "dcc"), "choose a --variant"),
        (("show", "--profile", "quik"), "did you mean 'quick'?"),
    ],
)
def test_what_is_not_there_is_refused(arguments: tuple[str, ...], said: str) -> None:
    """In one line."""
    answer = msgdrop("config", *arguments)
    assert answer.code == 2
    assert said in answer.err.splitlines()[-1]
