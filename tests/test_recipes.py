"""What docs/adding.md says is what happens: its files are saved, its lines are typed."""

import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import msgdrop_envs
from msgdrop_cli import algorithms, channels
from msgdrop_cli.algorithms.discovery import learner_class, learners
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine.offers import catalogue
from tests.cli_runs import ROOT, Said, msgdrop

PAGE = (ROOT / "docs" / "adding.md").read_text()
BLOCK = re.compile(
    r"```(?:python|toml)\n# ([\w./-]+)(?:; then: (msgdrop [^\n]*))?\n(.*?)```", re.DOTALL
)
FILES = {path: text for path, _, text in BLOCK.findall(PAGE)}
LINES = {path: line for path, line, _ in BLOCK.findall(PAGE) if line}
PACKAGES: dict[str, ModuleType] = {
    "msgdrop_cli/algorithms": algorithms,
    "msgdrop_cli/channels": channels,
    "envs/msgdrop_envs": msgdrop_envs,
}
BOTH: dict[str, object] = {"algorithm": {}, "training": {}}
SHORT = (
    *("--steps", "200", "--workers", "1", "--set", "training.games=4"),
    *("--set", "training.log_every_env_steps=50", "--set", "environment.time_limit=20"),
    *("--set", "algorithm.replay_capacity=400", "--set", "algorithm.replay_start_env_steps=100"),
)
"""What makes a training of minutes one of a second."""


@pytest.fixture(scope="module", autouse=True)
def saved(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the files as the page names them, where Python looks as it does in ours."""
    root, before = tmp_path_factory.mktemp("saved"), set(sys.modules)
    for path, text in FILES.items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text)
    (root / "envs/msgdrop_envs/parrot/__init__.py").touch()
    for path, package in PACKAGES.items():
        package.__path__.append(str(root / path))
    yield root
    for path, package in PACKAGES.items():
        package.__path__.remove(str(root / path))
    for name in set(sys.modules) - before:
        file = getattr(sys.modules[name], "__file__", None)
        if file and Path(file).is_relative_to(root):
            del sys.modules[name]


@pytest.fixture(scope="module")
def trained(saved: Path) -> Path:
    """A results folder with a run of the recipe's learner."""
    said = typed("msgdrop_cli/algorithms/blackout.py", "--results", saved / "results", *SHORT)
    assert said.code == 0, said.err
    return saved / "results"


def told(name: str) -> str:
    """What `explain` says of it, in one line."""
    return " ".join(msgdrop("explain", name).out.split())


def typed(file: str, *more: str | Path) -> Said:
    """What the line does that the page has behind a file's name."""
    _, *arguments = shlex.split(LINES[file])
    return msgdrop(*arguments, *more)


def test_the_recipe_of_a_question_is_one(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Saved as it stands there it plans four runs, of two different settings."""
    monkeypatch.chdir(saved)
    assert "4 runs: 4 new" in typed("mine.toml", "--dry-run").out
    asked = plan(load_definition("mine.toml"), "quick", catalogue())
    rates = {run.variant: run.spec.algorithm_config.rate for run in asked.runs}
    assert rates == {"dcc": 0.0, "md-0.05": 0.05}


def test_the_recipe_of_a_learner_is_one(trained: Path) -> None:
    """It is trained and shown, and its settings are known."""
    said = msgdrop("status", trained)
    assert "blackout" in said.out
    assert "1 run: 1 done" in said.out
    assert told("blackout").endswith("in pursuit-n6 train_env_steps=1000000")
    assert "algorithm.rate=0.2" in msgdrop("train", "--algorithm", "blackout", "--set", "help").out


def test_a_learner_is_not_trained_where_it_has_no_sizes(saved: Path) -> None:
    """The line says where they could stand."""
    said = typed("msgdrop_cli/algorithms/blackout.py", "--env", "pursuit-n8", "--dry-run")
    assert said.code == 2
    assert "no [pursuit-n8.blackout] in paper.toml or a sizes.toml of the game" in said.err
    assert "no SIZES in blackout.py" in said.err


def test_a_learners_sizes_may_be_those_of_any_pettingzoo_game(
    saved: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are called `foreign`, as in our own table of them."""
    monkeypatch.setattr(learners()["blackout"], "SIZES", {"foreign": BOTH})
    said = typed(
        *("msgdrop_cli/algorithms/blackout.py", "--env", "tests.somebodys_game:Echo"),
        *("--dry-run", "--json"),
    )
    assert said.code == 0, said.err


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        ({"pursuit-n7": BOTH}, "blackout.py: SIZES.pursuit-n7: no environment; did you mean"),
        ({"pursuit-n6": {"algorithm": {}}}, "blackout.py: SIZES.pursuit-n6.blackout"),
        ({"pursuit-n6": 3}, "blackout.py: SIZES.pursuit-n6.blackout: expected a table"),
        (3, "blackout.py: SIZES: expected a table, not 3"),
    ],
)
def test_a_learners_sizes_are_read_strictly(
    sizes: object, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One line names the file and the place."""
    monkeypatch.setattr(learners()["blackout"], "SIZES", sizes)
    said = typed("msgdrop_cli/algorithms/blackout.py", "--dry-run")
    assert said.code == 2
    assert message in said.err


def test_the_recipe_of_a_channel_is_one(trained: Path) -> None:
    """What was trained is played through it, and it is explained."""
    said = typed("msgdrop_cli/channels/lossy.py", trained, "--episodes", "8", "--workers", "1")
    assert said.code == 0, said.err
    assert "lossy 0.3" in said.out
    assert "Each message is lost by itself" in told("lossy")


def test_the_recipe_of_a_game_is_one(saved: Path, tmp_path: Path) -> None:
    """It is trained beside ours with its own sizes, and random play is its baseline."""
    said = typed("envs/msgdrop_envs/parrot/rules.py", "--results", tmp_path, *SHORT)
    assert said.code == 0, said.err
    assert "parrot-n3 after 200 env steps" in said.out
    assert "(random)" in said.out
    assert "for dcc f_units=[8, 8], g_units=8" in told("parrot-n3")
    record = (next(tmp_path.rglob("run.json"))).read_text()
    assert '"g_units": 8' in record


def test_a_recipe_touches_one_file_and_a_game_three() -> None:
    """The folder's empty file included."""
    assert sorted(FILES) == [
        "envs/msgdrop_envs/parrot/rules.py",
        "envs/msgdrop_envs/parrot/sizes.toml",
        "mine.toml",
        "msgdrop_cli/algorithms/blackout.py",
        "msgdrop_cli/channels/lossy.py",
    ]


def test_a_learner_is_what_its_recipe_says() -> None:
    """A file with Config and NAMED, and a class called like it in capitals."""
    for name, module in learners().items():
        assert learner_class(name) is getattr(module, name.upper())
        assert module.NAMED
        assert module.Config()
