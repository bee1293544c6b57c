"""Claims and what decides them, as a question states both."""

import re
import tomllib
from pathlib import Path

import pytest

from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.registration import registered_as
from msgdrop_cli.definition.spec import Registration
from msgdrop_cli.definition.strict import build
from tests.test_definition_load import GOOD, load

BOTH = 'better = "b-0.2"\nworse = ["a"]'
REGISTERED = """
[registration]
looks = [6, 10]
alpha_spent = [0.02, 0.05]
margin = { score = 1 }
"""


NAMES = {
    "architecture": "f46f0e1b",
    "autoencoder": "29c3c073",
    "blockwise-vs-elementwise": "ea930d55",
    "broken-links": "885a92ad",
    "dropout-rate": "e6a1767e",
    "message-scale": "1b0f0059",
    "navigation": "0a72786f",
    "own-observation": "c7762b25",
    "trained-through": "7e81e18f",
    "waterworld": "412388b1",
}
"""What the runs that were planned under these registrations have in their records."""
IN_GAME = {
    ("broken-links", "pursuit-n8"): "b3176346",
    ("dropout-rate", "pursuit-n8"): "3f971ad4",
    ("waterworld", "waterworld-n8"): "add430c6",
}
"""Where something else had been seen than `NAMES` says: nothing, or seeds 1 and 2."""


def test_an_order_is_its_neighbours(tmp_path: Path) -> None:
    """`a > b > c` is two orderings, in each of the environments."""
    file = tmp_path / "mine.toml"
    third = '[variants.c]\nlabel = "C"\nalgorithm = { name = "plain" }\n'
    text = GOOD.replace(BOTH, 'order = "c > b-0.2>a"')
    file.write_text(text.replace("[variants.a]", third + "[variants.a]"))
    claims = load_definition(str(file)).claims
    assert [(c.environment, c.better, c.worse) for c in claims] == [
        ("tiny-n2", "c", "b-0.2"),
        ("tiny-n2", "b-0.2", "a"),
        ("tiny-n4", "c", "b-0.2"),
        ("tiny-n4", "b-0.2", "a"),
    ]


@pytest.mark.parametrize(
    ("instead", "message"),
    [
        ('worse = ["a"]', ".better: expected at least one"),
        (f'{BOTH}\norder = "b-0.2 > a"', ': expected better and worse, or order = "a > b > c"'),
        ('order = "b-0.2"', ': expected better and worse, or order = "a > b > c"'),
        ('order = "a > b-0.3"', ".order: 'b-0.3' is not in this file; did you mean 'b-0.2'?"),
        ('order = "a > b-0.2 > a"', ".order.a: is listed twice"),
    ],
)
def test_a_mistake_in_an_order_is_one_clear_line(
    tmp_path: Path, instead: str, message: str
) -> None:
    """An order stands for better and worse, and names each variant once."""
    assert load(tmp_path, GOOD.replace(BOTH, instead)) == f"claims.1{message}"


def test_a_registration_is_read(tmp_path: Path) -> None:
    """Two sides unless it says one; without it there is none."""
    file = tmp_path / "mine.toml"
    file.write_text(GOOD)
    assert load_definition(str(file)).registration is None
    assert registered_as(load_definition(str(file)), "tiny-n2") is None
    file.write_text(GOOD + REGISTERED)
    read = load_definition(str(file))
    assert read.registration == Registration(
        looks=(6, 10), alpha_spent=(0.02, 0.05), sides=2, margin={"score": 1.0}, seen=0
    )
    assert re.fullmatch("mine:[0-9a-f]{8}", registered_as(read, "tiny-n2") or "")


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("6, 10", "6, 11", False),
        ("0.02", "0.03", False),
        ("{ score = 1 }", "{ score = 2 }", False),
        ("looks", "seen = 6\nlooks", False),
        ("looks", "sides = 1\nlooks", False),
        ('worse = ["a"]\nenvironment = ["tiny-n2", "tiny-n4"]',
         'worse = ["a"]\nenvironment = "tiny-n2"', False),
        ("B beats A", "A is beaten", True),
        ("seeds = 2", "seeds = 3", True),
    ],
)  # fmt: skip
def test_a_registration_is_known_by_what_can_change_a_verdict(
    tmp_path: Path, old: str, new: str, same: bool
) -> None:
    """Its rule and which claims there are; no word of a claim, and no scale."""
    file = tmp_path / "mine.toml"
    names = []
    assert old in GOOD + REGISTERED
    for text in (GOOD + REGISTERED, (GOOD + REGISTERED).replace(old, new, 1)):
        file.write_text(text)
        names.append(registered_as(load_definition(str(file)), "tiny-n2"))
    assert (names[0] == names[1]) == same


def test_what_was_seen_in_one_game_leaves_the_name_of_the_other(tmp_path: Path) -> None:
    """Records of the game that had been seen go on under the name they were trained under."""
    names = []
    for seen in ("", "seen = 6", "seen = 6\nseen_in = { tiny-n4 = 0 }"):
        file = tmp_path / "mine.toml"
        file.write_text(f"{GOOD}{REGISTERED}{seen}\n")
        read = load_definition(str(file))
        names.append([registered_as(read, game) for game in read.environments])
    of_none, of_all, of_one = names
    assert of_one == [of_all[0], of_none[1]]
    assert of_none[0] == of_none[1] != of_all[0]


def test_shipped_registrations_keep_their_names() -> None:
    """Else their runs would be said to have been trained under another one."""
    questions = map(load_definition, list_definitions())
    for each in questions:
        for game in each.environments:
            known = IN_GAME.get((each.name, game), NAMES[each.name])
            assert registered_as(each, game) == f"{each.name}:{known}"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[6, 10]", "[]", ": looks needs 1 to 12 rising numbers of seeds, from 2 to 1,000"),
        ("[6, 10]", "[10, 6]", ": looks needs 1 to 12 rising numbers of seeds, from 2 to 1,000"),
        ("[6, 10]", "[6, 1001]", ": looks needs 1 to 12 rising numbers of seeds, from 2 to 1,000"),
        ("[6, 10]", "[1, 10]", ": looks needs 1 to 12 rising numbers of seeds, from 2 to 1,000"),
        ("[6, 10]", "[6]", ": alpha_spent must have a number for each of the looks"),
        ("[0.02, 0.05]", "[0.05, 0.02]", ": alpha_spent adds up: numbers between 0 and 1 that do "
         "not decrease"),
        ("[0.02, 0.05]", "[0.02, 1.0]", ": alpha_spent adds up: numbers between 0 and 1 that do "
         "not decrease"),
        ("score = 1", "score = 0", ": a margin must be above 0"),
        ("score = 1", "scores = 1", ".margin.scores: no claim compares it; did you mean 'score'?"),
        ("looks", "seen = -1\nlooks", ": seen cannot be negative"),
        ("looks", "seen_in = { tiny-n2 = -1 }\nlooks", ": seen cannot be negative"),
        ("looks", "seen_in = { tiny-n22 = 0 }\nlooks",
         ".seen_in: 'tiny-n22' is not in this file; did you mean 'tiny-n2'?"),
        ("looks", "sides = 3\nlooks", ".sides: expected one of 1, 2, not 3"),
        ("looks", "look = 3\nlooks", ".look: unknown key; did you mean 'looks'?"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_registration_is_one_clear_line(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    """It is read as strictly as everything else."""
    text = REGISTERED.replace(old, new, 1)
    assert text != REGISTERED
    assert load(tmp_path, GOOD + text) == f"registration{message}"


def test_a_family_has_an_end(tmp_path: Path) -> None:
    """All sets of its claims are tested: eleven would be 2,047."""
    variants = "".join(
        f'[variants.c{n}]\nlabel = "C{n}"\nalgorithm = {{ name = "plain" }}\n' for n in range(11)
    )
    text = GOOD.replace("[profiles.quick]", variants + "[profiles.quick]")
    text = text.replace('worse = ["a"]', f"worse = {[f'c{n}' for n in range(11)]}")
    assert load(tmp_path, text + REGISTERED) == (
        "registration: 11 claims are of one family (tiny-n2, after training); at most 10 can be"
        " judged together"
    )


def test_the_documented_registration_is_a_shipped_one() -> None:
    """What docs/verdicts.md shows is what decides the broken links."""
    page = (Path(__file__).parents[1] / "docs" / "verdicts.md").read_text()
    [text] = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    table = tomllib.loads(text)["registration"]
    assert build(Registration, table, "docs") == load_definition("broken-links").registration
