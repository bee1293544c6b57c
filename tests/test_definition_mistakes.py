"""A question's file with several mistakes is told all of them at once, a line each."""

from pathlib import Path

import pytest

from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.errors import DefinitionError, DefinitionErrors, Mistakes
from tests.cli_runs import msgdrop

HEAD = 'title = "T"\nquestion = "Q?"\nsource = "ours"\nenvironments = ["pursuit-n6"]\n'
DCC = '[variants.dcc]\nlabel = "DCC"\nalgorithm = { name = "dcc" }\n'
MD = '[variants.md]\nlabel = "MD"\nalgorithm = { name = "dcc-md" }\n'
QUICK = "[profiles.quick]\nseeds = 1\n"
CLAIM = '[[claims]]\nsays = "S"\nsource = "ours"\nmetric = "catches_per_500"\nworse = "dcc"\n'
HERE = 'environment = "pursuit-n6"\n'
MISTAKEN = {
    "keys and types": (
        HEAD.replace('"T"', "3") + f"chanels = ['none']\n{DCC}"
        '[variants.md]\nlabl = "MD"\nalgorithm = { name = "dcc-md" }\n'
        '[profiles.quick]\nseeds = "two"\n',
        (
            "title: expected a line of text, not 3",
            "chanels: unknown key; did you mean 'channels'?",
            "variants.md.labl: unknown key; did you mean 'label'?",
            "variants.md: 'label' is missing",
            "profiles.quick.seeds: expected a whole number or a list",
        ),
    ),
    "names in the file": (
        f'{HEAD}{DCC}{MD}{QUICK}variants = ["dc"]\nenvironments = ["pursuit-n8"]\n'
        f'{CLAIM}{HERE}better = "mdd"\n{CLAIM}environment = "pursuit"\nbetter = "md"\n',
        (
            "profiles.quick.environments: 'pursuit-n8' is not in this file",
            "profiles.quick.variants: 'dc' is not in this file; did you mean 'dcc'?",
            "claims.1.better: 'mdd' is not in this file; did you mean 'md'?",
            "claims.2.environment: 'pursuit' is not in this file",
        ),
    ),
    "names of its own": (
        HEAD.replace('6"]', '6", "pursuit-n6"]')
        + DCC.replace("variants.dcc", 'variants."a b"')
        + f"{DCC}{QUICK}variants = []\n"
        + "[registration]\nlooks = [6]\nalpha_spent = [0.05]\nseen_in = { pursuit = 6 }\n",
        (
            "environments.pursuit-n6: is listed twice",
            'variants."a b": a name is 1 to 64 letters',
            "variants.dcc.label: 'a b' has it, too",
            "profiles.quick.variants: expected at least one",
            "registration.seen_in: 'pursuit' is not in this file",
        ),
    ),
    "names and settings that there are": (
        HEAD
        + DCC.replace('"dcc"', '"dccc"')
        + MD.replace('"dcc-md"', '"dcc-md", rte = 0.2, gamma = "x"')
        + "environment = { sigt = 3 }\ntraining = { games = 1.5 }\n"
        + f'{QUICK}{CLAIM.replace("catches", "caches")}{HERE}better = "md"\n',
        (
            "variants.dcc.algorithm.name: no algorithm is called 'dccc'; did you mean 'dcc'?",
            "variants.md.environment.sigt: unknown key; did you mean 'sight'?",
            "variants.md.algorithm.rte: unknown key; did you mean 'rate'?",
            "variants.md.algorithm.gamma: expected a finite number, not 'x'",
            "variants.md.training.games: expected a whole number, not 1.5",
            "claims.metric: pursuit-n6 does not measure 'caches_per_500'; did you mean",
        ),
    ),
}


@pytest.mark.parametrize("kind", MISTAKEN)
def test_all_mistakes_are_told_at_once(kind: str, tmp_path: Path) -> None:
    """A line each, in the order of the file, and nothing is written."""
    text, expected = MISTAKEN[kind]
    file = tmp_path / "mine.toml"
    file.write_text(text)
    said = msgdrop("ablate", file, "--results", tmp_path / "results")
    assert (said.code, said.out) == (2, "")
    for line, each in zip(said.err.splitlines(), expected, strict=True):
        assert line.startswith(f"msgdrop: error: {file}: {each}")
    assert list(tmp_path.iterdir()) == [file]


def test_a_file_full_of_mistakes_does_not_fill_the_screen(tmp_path: Path) -> None:
    """Twenty are told, and how many there are more."""
    file = tmp_path / "mine.toml"
    keys = "".join(f"key{number} = 1\n" for number in range(95))
    file.write_text(f"{keys}{HEAD}{DCC}{QUICK}")
    said = msgdrop("ablate", file)
    assert said.code == 2
    assert len(lines := said.err.splitlines()) == 21
    assert lines[-1] == "and 75 more"


def test_several_mistakes_are_one_line_as_a_text(tmp_path: Path) -> None:
    """The first, for who puts it into a line of his own."""
    file = tmp_path / "mine.toml"
    file.write_text(MISTAKEN["keys and types"][0])
    with pytest.raises(DefinitionErrors) as caught:
        load_definition(str(file))
    assert str(caught.value) == f"{file}: title: expected a line of text, not 3"
    assert len(caught.value.errors) == 5


def test_a_mistake_is_told_once() -> None:
    """However many runs it spoils; one alone is an error as any other."""
    mistakes = Mistakes()
    for _ in range(3):
        with mistakes:
            raise DefinitionError("the same")
    with pytest.raises(DefinitionError) as caught:
        mistakes.tell()
    assert type(caught.value) is DefinitionError


def test_what_is_no_mistake_of_the_user_goes_on() -> None:
    """Only DefinitionErrors are gathered."""
    with pytest.raises(KeyError), Mistakes():
        raise KeyError


def test_without_mistakes_nothing_is_raised() -> None:
    """As a file that is right."""
    mistakes = Mistakes()
    with mistakes:
        read = 1
    mistakes.tell()
    assert (read, mistakes.found) == (1, {})
