"""Definitions are read from TOML, whole or not at all."""

import random
from pathlib import Path

import pytest

from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.errors import DefinitionError

GOOD = """
title = "A title"
question = "A question?"
source = "l. 1"
environments = ["tiny-n2", "tiny-n4"]

[variants.a]
label = "A"
algorithm = { name = "plain" }
[variants."b-0.2"]
label = "B 0.2"
algorithm = { name = "dropping", rate = 0.2 }

[profiles.quick]
seeds = 2
environments = ["tiny-n2"]
broken_links = [0.5]

[[claims]]
says = "B beats A"
source = "l. 2"
better = "b-0.2"
worse = ["a"]
environment = ["tiny-n2", "tiny-n4"]
metric = "score"
broken_links = 0.5
"""


def load(folder: Path, text: str) -> str:
    """The message with which the definition `text` is refused."""
    file = folder / "mine.toml"
    file.write_text(text)
    with pytest.raises(DefinitionError) as caught:
        load_definition(str(file))
    message = str(caught.value)
    assert message.startswith(f"{file}: ")
    assert message.isprintable()
    return message.removeprefix(f"{file}: ")


def test_a_file_of_the_user_is_read(tmp_path: Path) -> None:
    """Name from the file, order of variants kept, overrides untouched."""
    file = tmp_path / "mine.toml"
    file.write_text(GOOD)
    read = load_definition(str(file))
    assert (read.name, list(read.variants)) == ("mine", ["a", "b-0.2"])
    assert read.variants["b-0.2"].algorithm == {"name": "dropping", "rate": 0.2}
    assert read.channels == (NONE_BROKEN,)
    assert read.profiles["quick"].channels == (Channel.read(0.5),)


def test_a_mark_of_the_byte_order_is_no_part_of_the_text(tmp_path: Path) -> None:
    """Editors of Windows begin UTF-8 with one, and end lines with CR LF."""
    file = tmp_path / "mine.toml"
    file.write_text(GOOD)
    plain = load_definition(str(file))
    file.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
    assert load_definition(str(file)) == plain


def test_another_encoding_is_named(tmp_path: Path) -> None:
    """What Windows calls Unicode is UTF-16: the line says what to save it as."""
    file = tmp_path / "mine.toml"
    file.write_text(GOOD, encoding="utf-16")
    with pytest.raises(DefinitionError, match="is not in UTF-8; save it in that encoding"):
        load_definition(str(file))


def test_lists_in_a_claim_are_every_combination(tmp_path: Path) -> None:
    """One sentence about two environments is two orderings."""
    file = tmp_path / "mine.toml"
    file.write_text(GOOD)
    claims = load_definition(str(file)).claims
    assert [(c.environment, c.better, c.worse) for c in claims] == [
        ("tiny-n2", "b-0.2", "a"),
        ("tiny-n4", "b-0.2", "a"),
    ]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('label = "B 0.2"', 'label = "A"', 'variants."b-0.2".label: \'a\' has it, too; tables '
         "and figures could not tell them apart"),
        ("title =", "titel =", "titel: unknown key; did you mean 'title'?"),
        ('title = "A title"', "", "'title' is missing"),
        ('title = "A title"', 'title = ""', "title: expected a line of text, not ''"),
        ("seeds = 2", 'seeds = "2"', "profiles.quick.seeds: expected a whole number or a list "
         "[a whole number, ...], not '2'"),
        ('["tiny-n2"]', '["tiny-n3"]', "profiles.quick.environments: 'tiny-n3' is not in this "
         "file; did you mean 'tiny-n4'?"),
        ('["tiny-n2"]', "[]", "profiles.quick.environments: expected at least one"),
        ("[variants.a]", '[variants."../a"]', 'variants."../a": a name is 1 to 64 letters, digits, '
         "dots, dashes and underscores, beginning with a letter or digit"),
        ("[variants.a]", '[variants."a/b"]', 'variants."a/b": a name is 1 to 64 letters, digits, '
         "dots, dashes and underscores, beginning with a letter or digit"),
        ('["tiny-n2", "tiny-n4"]\n\n', '["tiny-n2", "tiny-n2"]\n\n', "environments.tiny-n2: is "
         "listed twice"),
        ('{ name = "plain" }', "{ rate = 0.1 }", "variants.a: algorithm needs the name of an "
         'algorithm, e.g. { name = "dcc" }'),
        ('worse = ["a"]', 'worse = ["aa"]', "claims.1.worse: 'aa' is not in this file; did you "
         "mean 'a'?"),
        ('worse = ["a"]', 'worse = "b-0.2"', "claims.1: 'b-0.2' cannot be better than itself"),
        ("broken_links = 0.5", "broken_links = 1.0", "claims.1: no profile evaluates "
         "with all of the links broken; evaluated: none broken, half broken"),
        ("[0.5]", "[1.5]", "profiles.quick.broken_links.1: expected none, half, all, a share from "
         "0 to 1 (0.3 or 30%) or kind:settings, not 1.5"),
        ("seeds = 2", "seeds = 2\nevaluation_episodes = 0", "profiles.quick: evaluation_episodes "
         "must be at least 1, not 0"),
        ("seeds = 2", "seeds = 5000", "profiles.quick.seeds: expected 1 to 1000 seeds, not 5000"),
        ("seeds = 2", "seeds = [1, 2.5]", "profiles.quick.seeds.2: expected a whole number, not "
         "2.5"),
        ("seeds = 2", "seeds = [1, 1]", "profiles.quick.seeds: expected 1 to 1000 seeds, all "
         "different"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_clear_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    """Each mistake in a good file is named with its key and what was expected."""
    assert old in GOOD
    assert load(tmp_path, GOOD.replace(old, new, 1)) == message


def test_what_is_no_toml_is_refused(tmp_path: Path) -> None:
    """The parser's own words say where."""
    assert load(tmp_path, "title = ").startswith("is not TOML: Invalid value")


def test_an_unknown_name_gets_the_nearest() -> None:
    """A shipped definition that does not exist is answered with the one that was meant."""
    with pytest.raises(DefinitionError, match="did you mean 'dropout-rate'"):
        load_definition("dropuot-rate")


@pytest.mark.parametrize("name", ["missing.toml", "folder.toml", "loop.toml", "a\0.toml", ".toml"])
def test_a_path_that_is_no_file_is_refused(tmp_path: Path, name: str) -> None:
    """Missing, a folder, a link to itself, an impossible name: a DefinitionError each."""
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "loop.toml").symlink_to(tmp_path / "loop.toml")
    with pytest.raises(DefinitionError) as caught:
        load_definition(str(tmp_path / name))
    assert str(caught.value).isprintable()


def test_the_five_questions_of_the_paper_are_shipped() -> None:
    """Whoever looks for an ablation of the paper finds it under its name."""
    expected = {
        "dropout-rate",
        "blockwise-vs-elementwise",
        "own-observation",
        "architecture",
        "broken-links",
    }
    assert expected <= set(list_definitions())


def test_random_damage_never_raises_anything_else(tmp_path: Path) -> None:
    """500 damaged copies of a good file are read or refused with one printable line."""
    rng = random.Random(2)
    file = tmp_path / "mine.toml"
    bits = ["[", "]", "{", "}", "=", '"', "\n", ".", "9" * 5000, "nan", "inf", "\x00", "ü", "-"]
    bits += ["true", "1979-05-27", "[" * 2000, "0x" + "f" * 9000, "a=1\n", ",", "[[claims]]\n"]
    refusals = []
    for _ in range(500):
        text = GOOD
        for _ in range(rng.randrange(1, 3)):
            start = rng.randrange(len(text))
            text = text[:start] + rng.choice(bits) + text[start + rng.randrange(6) :]
        file.write_text(text)
        try:
            load_definition(str(file))
        except DefinitionError as error:
            refusals.append(str(error))
    assert all(line.isprintable() for line in refusals)
    assert 300 < len(refusals) < 500
