"""What help and the TAB key say is what is found when the sources are loaded."""

from dataclasses import fields

import pytest

from msgdrop_cli.commands.parts import completion, sources, vocabulary
from msgdrop_cli.definition.spec import TrainingSpec
from msgdrop_cli.engine.offers import catalogue

KNOWN = catalogue()
CONFIGS = {
    **{name: named.config_class() for name, named in KNOWN.algorithms.items()},
    **{name: type(config)() for name, config in KNOWN.environments.items()},
    "": TrainingSpec(),
}


def test_every_name_is_found() -> None:
    """Learners and games that the registries find, and no others."""
    assert set(completion.algorithms()) == set(KNOWN.algorithms)
    assert set(completion.environments()) == set(KNOWN.environments)


@pytest.mark.parametrize("name", CONFIGS)
def test_every_setting_is_found(name: str) -> None:
    """Every field of a Config, in order, with its default and a sentence."""
    sections = vocabulary.sections(name, name) if name else vocabulary.sections()
    [*_, section] = sections if name else sections[:1]
    config = CONFIGS[name]
    wanted = [(f.name, sources.notation(getattr(config, f.name))) for f in fields(config)]
    assert [(setting.key, setting.default) for setting in section.settings] == wanted
    assert all(setting.meaning.endswith(".") for setting in section.settings)


def test_where_a_value_comes_from_is_left_out() -> None:
    """Lines of the paper are for readers of the source; what else stands in brackets is not."""
    [_, dcc, _] = vocabulary.sections("pursuit-n6", "dcc")
    meanings = {setting.key: setting.meaning for setting in dcc.settings}
    assert meanings["rate"] == "Probability of dropping a message (or an element) in training."
    assert meanings["gamma"] == "Discount."


def test_values_are_written_as_they_are_read() -> None:
    """In the notation of TOML and of `--set`."""
    values = (True, (64, 48), "message", 1e-4, 5)
    written = ["true", "[64, 48]", "message", "0.0001", "5"]
    assert [sources.notation(value) for value in values] == written
