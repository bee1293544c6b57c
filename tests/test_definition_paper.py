"""`paper.toml` is read whole or not at all, and what it does not say is nobody's size."""

from dataclasses import replace

import pytest

from msgdrop_cli.definition.catalogue import PaperSizes
from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.paper import sizes_in
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.strict import Where
from msgdrop_cli.errors import DefinitionError
from tests.definition_samples import CATALOGUE, DEFINITION, Learner

GOOD = """
[tiny-n2.lab]
algorithm = { widths = [3, 4], rate = 0 }
training = { train_env_steps = 1e3 }
"""


def read(text: str) -> dict[tuple[str, str], PaperSizes]:
    """The sizes in a text, for the small world of the tests of planning."""
    return sizes_in(text.encode(), Where("paper.toml"), ["tiny-n2"], {"lab": Learner})


def test_a_pair_has_the_types_of_its_configs() -> None:
    """A list is a tuple as in the Config, 0 a float, and 1e3 a whole number."""
    sizes = read(GOOD)["tiny-n2", "lab"]
    assert sizes.algorithm == {"widths": (3, 4), "rate": 0.0}
    assert repr(sizes.training) == "{'train_env_steps': 1000}"


@pytest.mark.parametrize(
    ("good", "bad", "message"),
    [
        ("tiny-n2", "tiny-n3", "tiny-n3: no environment; did you mean 'tiny-n2'?"),
        ("lab", "lob", "tiny-n2.lob: no learner; did you mean 'lab'?"),
        ("widths", "width", "tiny-n2.lab.algorithm.width: unknown key; did you mean 'widths'?"),
        ("1e3", '"long"', "tiny-n2.lab.training.train_env_steps: expected a whole number"),
        ("training", "train", "tiny-n2.lab.train: unknown key; did you mean 'training'?"),
        ("[tiny-n2", "[[tiny-n2", "is not TOML"),
    ],
)
def test_what_does_not_fit_is_one_clear_line(good: str, bad: str, message: str) -> None:
    """File, place, and the nearest name."""
    with pytest.raises(DefinitionError) as caught:
        read(GOOD.replace(good, bad))
    assert str(caught.value).startswith(f"paper.toml: {message}")


def test_a_pair_without_sizes_is_not_planned() -> None:
    """Nobody is given the sizes of another game; the line says who has some."""
    sizes = {pair: sizes for pair, sizes in CATALOGUE.paper.items() if pair[0] != "tiny-n4"}
    with pytest.raises(DefinitionError) as caught:
        plan(DEFINITION, "paper", replace(CATALOGUE, paper=sizes))
    assert str(caught.value) == (
        "tiny-n4, plain: no sizes are known of lab there: no [tiny-n4.lab] in paper.toml"
        " or a sizes.toml of the game, no SIZES in lab.py;"
        " what fits: nothing yet"
    )


def test_the_file_of_sizes_is_no_question() -> None:
    """It lies beside the questions, and is neither listed nor loaded as one."""
    assert "paper" not in list_definitions()
    with pytest.raises(DefinitionError, match="no ablation is called 'paper'"):
        load_definition("paper")
