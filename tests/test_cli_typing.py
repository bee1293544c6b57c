"""What people type, and what they are told about it: help, TAB, and other ways to write a thing."""

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from msgdrop_cli import app
from msgdrop_cli.commands.parts import words
from msgdrop_cli.definition.channel import Channel
from tests.cli_runs import QUESTION, ROOT, msgdrop
from tests.test_rooms import HEAVY

COMMANDS: dict[str, Any] = typer.main.get_command(app.app).commands  # type: ignore[attr-defined]
"""Every command by name, as typer has made it."""


@pytest.fixture
def question(tmp_path: Path) -> Path:
    """A question of four tiny runs."""
    path = tmp_path / "tiny.toml"
    path.write_text(QUESTION)
    return path


def planned(*arguments: str | Path) -> list[dict[str, Any]]:
    """The runs that a command line would train."""
    said = msgdrop(*arguments, "--dry-run", "--json")
    assert said.code == 0, said.err
    runs: list[dict[str, Any]] = json.loads(said.out)["runs"]
    return runs


def ids(*arguments: str | Path) -> list[str]:
    """Their ids."""
    return [run["run_id"] for run in planned(*arguments)]


def offered(line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """What the TAB key offers at the end of a command line, in bash."""
    monkeypatch.setenv("_MSGDROP_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(f"{line}x".split()) - 1))
    with pytest.raises(SystemExit):
        app.run([])
    return capsys.readouterr().out.split()


@pytest.mark.parametrize("name", COMMANDS)
def test_paths_and_numbers_are_read_in_one_way(name: str) -> None:
    """No option has typer's own path or number, which know neither `~` nor `1e6`."""
    readers = {type(parameter.type).__name__ for parameter in COMMANDS[name].params}
    assert readers <= {"FuncParamType", "StringParamType", "BoolParamType"}


def test_a_tilde_is_the_home(
    question: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In folders and files, as an option's value and as an argument; of somebody unknown: 2."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert ids("ablate", "~/tiny.toml") == ids("ablate", question)
    for arguments in (
        ("status", "~/results"),
        ("publish", "~/tiny.toml", "--results=~/results", "--to=~/published"),
        ("import", "~/results"),
    ):
        said = msgdrop(*arguments)
        assert said.code == 2
        assert f"{tmp_path}/results" in said.err
    assert "whose home is not known" in msgdrop("status", "~nobody-at-all/x").err
    assert not (tmp_path / "~").exists()


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        (("--steps", "1e5"), ()),
        (("--steps", "100_000", "--workers", "1e0"), ()),
        (("--set", "training.train_env_steps=1e5"), ()),
        (("--rate", "30%"), ("--set", "algorithm.rate=0.3")),
        (("--rate", "33.3%"), ("--set", "algorithm.rate=0.333")),
        (("--rate", ".2"), ()),
        (("--seed", "1"), ()),
        (("--seed", "1e2"), ("--seeds", "100,")),
    ],
)
def test_one_thing_written_in_two_ways_is_one_run(
    typed: tuple[str, ...], meant: tuple[str, ...]
) -> None:
    """`train` without options is DCC-MD 0.2, seed 1, over 100,000 env steps."""
    assert ids("train", *typed) == ids("train", *meant)


@pytest.mark.parametrize(
    ("steps", "explores"), [("3e5", 150_000), ("4e6", 2_000_000), ("5e6", 2_000_000)]
)
def test_a_shorter_training_explores_for_half_of_it(steps: str, explores: int) -> None:
    """And a longer one as long as the paper's (l. 753)."""
    anneal = f"algorithm.epsilon_anneal_env_steps={explores}"
    length = ("--set", f"training.train_env_steps={steps}", "--set", anneal)
    assert ids("train", "--steps", steps) == ids("train", *length)


@pytest.mark.parametrize("profile", ["quick", "million", "paper"])
@pytest.mark.parametrize(
    ("environment", "question"), [("pursuit-n6", "dropout-rate"), ("navigation-n8", "navigation")]
)
def test_a_scale_of_train_is_that_of_the_questions(
    environment: str, question: str, profile: str
) -> None:
    """One name of a profile means one run, whoever asks for it."""
    alone = ids("train", "--env", environment, "--algorithm", "dcc", "--profile", profile)
    assert set(alone) <= set(ids("ablate", question, "--profile", profile, "--seed", "1"))


def test_a_learner_without_epsilon_takes_steps() -> None:
    """MADDPG has nothing to anneal."""
    [run] = planned("train", "--env", "waterworld-n8", "--algorithm", "maddpg", "--steps", "1e4")
    assert run["train_env_steps"] == 10_000


def test_seed_is_one_seed_and_seeds_are_several(question: Path) -> None:
    """`--seed 3` is the third seed alone."""
    assert {run["seed"] for run in planned("ablate", question, "--seed", "3")} == {3}
    assert {run["seed"] for run in planned("ablate", question, "--seeds", "3")} == {1, 2, 3}


def test_the_only_profile_need_not_be_named(question: Path) -> None:
    """Of several, quick is meant; without one that is called so, the line says what there is."""
    only = question.with_name("only.toml")
    only.write_text(QUESTION.replace("profiles.quick", "profiles.tiny"))
    assert ids("ablate", only) == ids("ablate", question)
    said = msgdrop("publish", only, "--results", question.parent)
    assert "tiny.toml" not in said.err
    assert "profile tiny" in said.err
    only.write_text(f"{only.read_text()}[profiles.small]\nseeds = 1\n")
    assert "which one is meant? --profile tiny or small" in msgdrop("ablate", only).err


@pytest.mark.parametrize("name", COMMANDS)
def test_help_ends_with_examples_that_can_be_typed(name: str) -> None:
    """`-h` is `--help`; each of its two or more examples is a command line that is understood."""
    said = msgdrop(name, "-h")
    assert said.code == 0
    assert said.out == msgdrop(name, "--help").out
    lines = [line.split("  (")[0] for line in said.out.splitlines() if "    msgdrop " in line]
    assert len(lines) >= 2
    for line in lines:
        _, command, *arguments = shlex.split(line)
        assert command == name
        COMMANDS[name].make_context(name, arguments)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_fits_into_a_terminal(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """No line is longer than the 80 columns that a terminal has at least."""
    monkeypatch.setenv("COLUMNS", "80")
    assert max(map(len, msgdrop(name, "-h").out.splitlines())) <= 80


def test_help_lists_what_set_takes() -> None:
    """Every learner's and every game's keys with their defaults."""
    said = " ".join(msgdrop("train", "-h").out.split())
    for setting in ("target_update_every_updates=1000", "tau=0.01", "sensors=25", "games=8"):
        assert setting in said


def test_set_help_says_what_settings_mean(question: Path) -> None:
    """With the values that this question's runs would have; nothing is trained."""
    said = msgdrop("ablate", question, "--set", "help", "--set", "algorithm.gamma=0.9")
    assert said.code == 0, said.err
    assert "training.train_env_steps=200" in said.out
    assert "algorithm.gamma=0.9 " in said.out
    assert "Probability of dropping a message" in said.out
    rows = json.loads(msgdrop("train", "--set", "help", "--json").out)
    assert {"setting": "algorithm.gamma", "value": 0.99, "meaning": "Discount."} in rows


def test_list_is_the_list_of_questions() -> None:
    """As `ablate` alone."""
    assert msgdrop("ablate", "--list") == msgdrop("ablate")


def test_an_algorithm_that_does_not_fit_is_told_who_does(tmp_path: Path) -> None:
    """`train --env waterworld-n8` alone asks for DCC-MD, which cannot act there."""
    said = msgdrop("train", "--env", "waterworld-n8", "--results", tmp_path / "results")
    assert said.code == 2
    assert said.err.endswith("what fits: ddpg, vanilla-maddpg, maddpg, maddpg-md\n")
    assert not (tmp_path / "results").exists()
    other = msgdrop("train", "--algorithm", "maddpg", "--dry-run")
    assert "pursuit-n6, maddpg: " in other.err
    assert "fdc, dcc, dcc-md" in other.err.partition("what fits: ")[2]


@pytest.mark.parametrize(
    ("line", "some"),
    [
        ("msgdrop train --algorithm ", ["dcc-md", "maddpg"]),
        ("msgdrop train --env p", ["pursuit-n6", "pursuit-n8"]),
        ("msgdrop train --profile ", ["quick", "million", "paper"]),
        ("msgdrop ablate bro", ["broken-links"]),
        ("msgdrop ablate figure-5", ["figure-5a", "figure-5b"]),
        ("msgdrop ablate figure-3f --profile h", ["half-million"]),
        ("msgdrop ablate waterworld --profile h", ["half-million"]),
        ("msgdrop ablate --profile ", ["quick-nearest", "two-million"]),
        ("msgdrop publish navigation --profile two", []),
        ("msgdrop ablate no-such-question --profile ", []),
        ("msgdrop train --algorithm maddpg --set algorithm.t", ["algorithm.tau="]),
        ("msgdrop ablate navigation --set environment.l", ["environment.landmarks="]),
        ("msgdrop ablate navigation --set environment.food", []),
        ("msgdrop ablate navigation --reading n", ["nearest", "near-sight"]),
        ("msgdrop ablate navigation --reading capt", []),
        ("msgdrop publish dropout-rate --reading ", ["capture-once", "huber"]),
        ("msgdrop eval --broken-links ", ["half"]),
        ("msgdrop unstable-test --device c", ["cuda"]),
        ("msgdrop explain catches", ["catches_per_500"]),
        ("msgdrop config show dropout-rate --variant md", ["md-0.2", "md-0.5"]),
        ("msgdrop config show navigation --profile q", ["quick"]),
        ("msgdrop mirror --to t", ["tensorboard", "trackio"]),
    ],
)
def test_tab_offers_what_there_is(
    line: str,
    some: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Names, profiles and settings that fit what stands on the line."""
    found = offered(line, monkeypatch, capsys)
    assert set(some) <= set(found)
    assert bool(some) == bool(found)
    start = line.split(" ")[-1]
    assert all(each.startswith(start) for each in found)


def test_tab_loads_nothing_heavy() -> None:
    """The longest answer comes without torch."""
    words = {"COMP_WORDS": "msgdrop train --set ", "COMP_CWORD": "3"}
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "msgdrop_cli"],
        env={**os.environ, **words, "_MSGDROP_COMPLETE": "complete_bash", "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert "algorithm.rate=" in done.stdout
    loaded = {line.rsplit("|", 1)[-1].strip().split(".")[0] for line in done.stderr.splitlines()}
    assert loaded & HEAVY == set()


@pytest.mark.parametrize(
    ("text", "value"),
    [("30%", 0.3), ("0.3", 0.3), ("7 %", 0.07), ("0%", 0), (" 0.3", 0.3), ("0.3 ", 0.3)],
)
def test_shares_as_people_write_them(text: str, value: float) -> None:
    """Per cent are hundredths, exactly: 30% and 0.3 are one number."""
    assert Channel.read(text) == Channel.read(value)
    assert words.share(text, "--rate") == value


@pytest.mark.parametrize(
    ("typed", "says"),
    [
        ("train --algorithm ful-md", "--algorithm: no algorithm is called 'ful-md'"),
        ("ablate dropout-rate --profile two-millio", "did you mean 'two-million'?"),
        ("ablate dropout-rate --reading far-sigh", "did you mean 'far-sight'?"),
        ("eval --broken-links some", "--broken-links: no channel is called 'some'"),
        ("train --channel los:0.2", "--channel: no channel is called 'los'"),
        ("unstable-test --sweep los:0..1:3", "--sweep: no channel is called 'los'"),
    ],
)
def test_a_mistyped_name_is_told_before_torch_is_loaded(typed: str, says: str) -> None:
    """It takes seconds to load, and is not needed to know the names."""
    tell = "import sys; from msgdrop_cli.app import run; code = run(sys.argv[1:]); "
    tell += "sys.exit(code if 'torch' not in sys.modules else 99)"
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
    done = subprocess.run(
        [sys.executable, "-c", tell, *typed.split()],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (done.returncode, says in done.stderr) == (2, True), done.stderr
