"""What is mistyped is told before torch is loaded, from what the sources say."""

import ast
from dataclasses import asdict, fields

import pytest

from msgdrop_cli.channels import kinds
from msgdrop_cli.commands.parts import early, sources, vocabulary
from msgdrop_cli.commands.parts.sources import Module
from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.spec import FOREIGN
from msgdrop_cli.engine.offers import catalogue
from msgdrop_envs import packages
from tests.cli_runs import python

KNOWN = catalogue()
MISTYPED = {
    "train --env pursuit-n66": "did you mean 'pursuit-n6'?",
    "train --algorithm dccc": "did you mean 'dcc'?",
    "train --env waterworld-n8": "what fits: ddpg, vanilla-maddpg, maddpg, maddpg-md",
    "train --algorithm dcc --rate 0.3": "these take one: dcc-md, dcc-sd",
    "train --set algoritm.gamma=0.9": "did you mean 'algorithm'?",
    "train --set algorithm.gama=0.9": "--set: algorithm.gama: unknown key; did you mean 'gamma'?",
    "train --set algorithm.gamma=true": "algorithm.gamma: expected a finite number, not true",
    "train --set environment.sight=1.5": "environment.sight: expected a whole number, not 1.5",
    "train --set algorithm.f_units=[1,2,3]": "algorithm.f_units: expected 2 entries, not 3",
    "train --set algorithm.dropout=mesage": "did you mean 'message'?",
    "train --set algorithm.topology=rng": "did you mean 'ring'?",
    "train --channel lss:0.2": "--channel: no channel is called 'lss'; did you mean 'loss'?",
    "eval --channel loss:0.2,3": "--channel: loss:0.2,3: expected loss:RATE (loss:0.2)",
    "ablate dropout-rate --set variants.md-02.algorithm.rate=0.1": "no such variant",
    "ablate dropout-rate --set algorithm.gama=0.9": "did you mean 'gamma'?",
    "config show --env pursuit-n66": "did you mean 'pursuit-n6'?",
}
_TYPED = """
import sys
from msgdrop_cli.app import run
for line in sys.argv[1:]:
    assert run(line.split()) == 2, line
    assert "torch" not in sys.modules, line
"""


def test_what_is_mistyped_is_told_before_torch_is_loaded() -> None:
    """In one line each, which says what is wrong and what was meant."""
    done = python("-c", _TYPED, *MISTYPED)
    assert done.returncode == 0, done.stderr
    for said, expected in zip(done.stderr.splitlines(), MISTYPED.values(), strict=True):
        assert expected in said


def test_files_tell_what_is_found_when_they_are_loaded() -> None:
    """Every game, algorithm and size, with all defaults; every channel with its settings."""
    told = early.told()
    assert told is not None
    games = {name: asdict(config) for name, config in told.environments.items()}
    assert games == {name: asdict(config) for name, config in KNOWN.environments.items()}
    for name, known in KNOWN.algorithms.items():
        assert asdict(told.algorithms[name].config_class()) == asdict(known.config_class())
        assert told.algorithms[name].overrides == known.overrides
    assert told.algorithms.keys() == KNOWN.algorithms.keys()
    assert told.paper == {key: at for key, at in KNOWN.paper.items() if key[0] != FOREIGN}
    settings = {kind: [each.name for each in fields(cls)] for kind, cls in told.channels.items()}
    assert settings == {kind: [each.name for each in fields(cls)] for kind, cls in kinds().items()}


@pytest.mark.parametrize("name", list_definitions())
def test_shipped_questions_are_asked(name: str) -> None:
    """Nothing that is right is refused, at any scale."""
    definition = load_definition(name)
    for profile in definition.profiles:
        early.check_early(definition, profile, overrides=(), readings=())


def test_games_of_other_people_are_asked_themselves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their files may say it otherwise than ours, so that nothing is told from them."""
    monkeypatch.setattr(packages, "theirs", lambda: ["msgdrop_envs.pursuit"])
    assert early.told() is None


@pytest.mark.parametrize(
    "said", ["class Config(Other):\n    rate: float = 0.2", "from x.y import Config"]
)
def test_a_config_of_another_place_is_asked_itself(
    monkeypatch: pytest.MonkeyPatch, said: str
) -> None:
    """It may have fields that do not stand in the file."""
    tree = ast.parse(f"NAMED = {{'mine': {{}}}}\n{said}")
    monkeypatch.setattr(sources, "modules", lambda *_: [Module("mine", tree)])
    assert not any(each.complete for each in vocabulary.algorithms())


def test_a_default_that_is_reckoned_may_be_anything(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the file itself knows its value."""
    body = "class Config:\n    rate: float = RATES[0]\n    units: int = 4"
    tree = ast.parse(f"NAMED = {{'mine': {{}}}}\n{body}")
    monkeypatch.setattr(sources, "modules", lambda *_: [Module("mine", tree)])
    [section] = vocabulary.algorithms()
    config = early._config(section)
    assert [(each.name, each.type is int) for each in fields(config)] == [
        ("rate", False),
        ("units", True),
    ]
