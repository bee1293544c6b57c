"""Games of other people: found where they are installed, used like ours, refused in one line."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from msgdrop_cli.commands.parts import completion, vocabulary
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.errors import DefinitionError
from msgdrop_envs import registry
from msgdrop_envs.parallel import parallel_env
from tests.cli_runs import msgdrop
from tests.echo_game import RULES, install


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder where Python looks for packages; what is imported from it is forgotten again."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    yield folder
    forget()


def forget() -> None:
    """Let the package be imported from its file again."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "somebodys"]:
        del sys.modules[name]


def refusal() -> str:
    """The line with which every command refuses to go on."""
    with pytest.raises(DefinitionError) as caught:
        catalogue()
    assert str(caught.value).isprintable()
    return str(caught.value)


def test_an_installed_game_is_found(site: Path) -> None:
    """By its settings' names, and made like ours; so is a Config with other settings."""
    assert "echo-n3" not in registry.settings()
    install(site)
    config = registry.settings()["echo-n4"]
    assert registry.make("echo-n4").agents == 4
    assert registry.make(type(config)(agents=7)).agents == 7
    assert registry.game(config) == "echo"


def test_the_papers_sizes_are_joined_by_the_games_own(site: Path) -> None:
    """What `sizes.toml` says of (setting, learner) is planned with; ours are as before."""
    ours = catalogue()
    install(site)
    known = catalogue()
    sizes = known.sizes("echo-n3", "dcc")
    assert sizes.algorithm["f_units"] == (8, 8)
    assert sizes.training["train_env_steps"] == 400
    assert dict(known.paper).items() > dict(ours.paper).items()


def test_baselines_may_be_missing(site: Path) -> None:
    """There is random play without them."""
    install(site)
    assert list(registry.baselines(registry.make("echo-n3"))) == ["random"]


def test_a_view_may_be_missing(site: Path) -> None:
    """Then a game is played in batches, but not shown."""
    install(site)
    assert registry.view(registry.settings()["echo-n3"]) is None
    with pytest.raises(ValueError, match=r"echo cannot be shown: there is no view\.py"):
        parallel_env("echo-n3")


def test_view_and_baselines_are_found_beside_the_rules(site: Path) -> None:
    """They are what their names say, and nothing has to name them."""
    game = install(site)
    (game / "view.py").write_text("class EchoView:\n    def __init__(self, config): pass\n")
    (game / "baselines.py").write_text("def baselines(game): return {'all': None}\n")
    assert type(registry.view(registry.settings()["echo-n3"])).__name__ == "EchoView"
    assert list(registry.baselines(registry.make("echo-n3"))) == ["all"]


@pytest.mark.parametrize(
    ("rules", "said"),
    [
        ("import no_such_thing", "No module named 'no_such_thing'"),
        ("x = (", "SyntaxError"),
        ("raise SystemError('two\\n lines')", "SystemError: two lines"),
        ("x = 1", "has no attribute 'PAPER'"),
        (RULES.replace("class Echo", "class Other"), "has no attribute 'Echo'"),
        (RULES.replace("echo-n3", "pursuit-n6"), "another game has the name 'pursuit-n6', too"),
        (RULES.replace("echo-n3", "../echo"), "'../echo' is not a name"),
    ],
)
def test_a_package_without_a_usable_game_is_named(site: Path, rules: str, said: str) -> None:
    """With what is wrong; help and the TAB key go on without it."""
    install(site, rules=rules)
    line = refusal()
    assert line.startswith("somebodys.echo")
    assert said in line
    assert line.endswith("mend or uninstall this package")
    assert "pursuit-n6" in completion.environments()


@pytest.mark.parametrize("text", ["[echo-n3", "echo-n3 = 3", "\xff"])
def test_sizes_that_cannot_be_read_are_named(site: Path, text: str) -> None:
    """The file, in one line."""
    file = install(site) / "sizes.toml"
    file.write_text(text, "latin-1")
    assert refusal().startswith(f"{file}: ")


def test_a_package_that_is_not_there_is_named(site: Path) -> None:
    """Its entry point is left behind, say."""
    (install(site) / "rules.py").unlink()
    assert "No module named 'somebodys.echo.rules'" in refusal()


def test_its_names_and_settings_can_be_typed(site: Path) -> None:
    """The TAB key, `--set help` and `explain` know them."""
    install(site)
    assert "echo-n3" in completion.environments()
    [*_, game] = vocabulary.sections("echo-n3", "dcc")
    assert [(s.key, s.default, s.meaning) for s in game.settings] == [
        ("agents", "3", "N."),
        ("time_limit", "10", "T, steps."),
    ]
    said = msgdrop("train", "--env", "echo-n3", "--set", "help")
    assert "environment.time_limit=10" in said.out, said.err
    said = msgdrop("explain", "echo-n4")
    assert "Echo: every agent says what its left neighbour sees." in said.out
    assert "agents=4" in said.out
    assert "dcc in echo-n3 8" in " ".join(msgdrop("explain", "g_units").out.split())


def test_it_is_trained_and_reported_like_ours(site: Path, tmp_path: Path) -> None:
    """With its own sizes; without the package its records are read and its policies not played."""
    install(site)
    results = tmp_path / "results"
    where = ("--results", results, "--workers", "1")
    said = msgdrop("train", "--env", "echo-n3", "--profile", "paper", *where)
    assert said.code == 0, said.err
    assert "echo-n3 after 400 env steps (paper)" in said.out
    assert "(random)" in said.out
    forget()
    site.rename(tmp_path / "gone")
    said = msgdrop("plot", results)
    assert said.code == 0, said.err
    said = msgdrop("eval", results, "--episodes", "1001", "--workers", "1")
    assert said.code == 2
    assert "no environment is called 'echo-n3'" in said.err
    assert "a PettingZoo game is named module:factory; other games come with a package" in said.err
