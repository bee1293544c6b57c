"""What the TAB key offers in each shell, the runs that it finds, and what it does not load."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from msgdrop_cli import app
from msgdrop_cli.commands.parts import completion
from tests.cli_runs import ROOT

_TELLING = """
import os, sys
from msgdrop_cli.__main__ import main
leave = os._exit
def tell(code):
    print(*(name for name, module in sys.modules.items() if module), file=sys.stderr, flush=True)
    leave(code)
os._exit = tell
main()
"""
"""The program, which says at its end what it has loaded."""


def offered(shell: str, line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ask as the shell's own script does."""
    monkeypatch.setenv("_MSGDROP_COMPLETE", f"complete_{shell}")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(line.split()) - 1))
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", line)
    monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "get-args")
    with pytest.raises(SystemExit):
        app.run([])


@pytest.mark.parametrize(
    ("shell", "answer"),
    [
        ("bash", "pursuit-n6\npursuit-n8\n"),
        ("zsh", '_arguments \'*: :(("pursuit-n6"\n"pursuit-n8"))\'\n'),
        ("fish", "pursuit-n6\npursuit-n8\n"),
    ],
)
def test_every_shell_is_answered_in_its_own_way(
    shell: str, answer: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As the scripts of `--install-completion` read it."""
    offered(shell, "msgdrop train --env pursuit", monkeypatch)
    assert capsys.readouterr().out == answer


def pressed(line: str) -> tuple[list[str], set[str]]:
    """What fish is told by a process of its own, and the modules that were loaded for it."""
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
    asked = {"_MSGDROP_COMPLETE": "complete_fish", "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    done = subprocess.run(
        [sys.executable, "-c", _TELLING],
        env={**os.environ, **asked, "_TYPER_COMPLETE_ARGS": line, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0
    return done.stdout.splitlines(), set(done.stderr.split())


def test_a_help_is_one_line_behind_its_name() -> None:
    """However long; typer would break it at 80 columns, and fish offer its second half."""
    offers, loaded = pressed("msgdrop train --set ")
    assert all(line.count("\t") == 1 for line in offers)
    assert any(len(line) > 100 for line in offers)
    assert not [name for name in loaded if name.split(".")[0] == "rich"]


def test_a_command_waits_for_no_other() -> None:
    """The one on the line is loaded alone."""
    offers, loaded = pressed("msgdrop ablate dropout")
    assert offers == ["dropout-rate"]
    found = {name.removeprefix("msgdrop_cli.commands.") for name in loaded}
    assert found & {*app.COMMANDS.values()} == {"ablate"}


def test_a_command_is_called_as_it_is_found() -> None:
    """By the name that its file gives it, so that no other need be loaded to find it."""
    group: Any = typer.main.get_command(app.app)
    assert [group.commands[name].name for name in app.COMMANDS] == [*app.COMMANDS]


@pytest.mark.parametrize("command", ["watch", "replay"])
def test_runs_with_a_policy_are_offered(
    command: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Own ones and published ones, by their folders; those without a policy are not."""
    monkeypatch.chdir(tmp_path)
    folders = ("runs/game/a-s1-01234567", "published/a-question/game/b-s1-89abcdef")
    for folder in folders:
        (tmp_path / "results" / folder).mkdir(parents=True)
        (tmp_path / "results" / folder / "policy.safetensors").touch()
    (tmp_path / "results" / "runs" / "game" / "c-s1-00000000").mkdir()
    offered("bash", f"msgdrop {command} res", monkeypatch)
    assert capsys.readouterr().out.split() == sorted(f"results/{each}" for each in folders)


def test_the_profile_on_the_line_chooses_the_games(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What its games know is offered, whatever another game of the question lacks."""
    question = (ROOT / "ablations" / "demo.toml").read_text()
    games = 'environments = ["waterworld-n8", "pursuit-n6"]'
    changed = question.replace('environments = ["navigation-n8"]', games)
    changed = changed.replace('environment = { landmark_order = "nearest" }', "")
    changed += '\n[profiles.one]\nseeds = 1\nenvironments = ["pursuit-n6"]\n'
    (tmp_path / "asked.toml").write_text(changed)
    line = f"msgdrop ablate {tmp_path / 'asked.toml'} --profile one"
    offered("bash", f"{line} --reading capture", monkeypatch)
    assert capsys.readouterr().out.split() == ["capture-once"]
    offered("bash", f"{line} --set environment.evaders", monkeypatch)
    assert capsys.readouterr().out.split() == ["environment.evaders="]


_BASH = """
eval "$(_MSGDROP_COMPLETE=source_bash {program})"
COMP_WORDS=({words})
COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
_msgdrop_completion {program}
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.mark.parametrize(
    ("words", "offers"),
    [
        (["ablate", "dropout-rate", "--profile", "=", "tw"], ["two-million"]),
        (
            ["ablate", "dropout-rate", "--profile", "="],
            ["quick", "million", "two-million", "paper"],
        ),
        (
            ["train", "--set", "algorithm.gamma", "=", "0.9", "--env", "pursuit-n6", "--prof"],
            ["--profile"],
        ),
        (["eval", "--channel", "loss", ":", "0.2", "--device", "=", "cu"], ["cuda"]),
        (["unstable-test", "--sweep", "lo"], ["loss:"]),
    ],
)
def test_bash_parts_words_and_is_answered_all_the_same(
    words: list[str], offers: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """At `=` and `:`, as its own line editor does before it asks."""
    program = tmp_path / "msgdrop"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m msgdrop_cli "$@"\n')
    program.chmod(0o755)
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
    monkeypatch.setenv("PYTHONPATH", paths)
    asked = _BASH.format(program=program, words=" ".join(["msgdrop", *words]))
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == offers, done.stderr


def test_sides_of_a_diff_are_offered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Variants that have runs; ids as soon as one is begun."""
    monkeypatch.chdir(tmp_path)
    for name in ("runs/game/dcc-s1-01234567", "published/q/game/md-0.2-s2-d9abcdef"):
        folder = tmp_path / "results" / name
        folder.mkdir(parents=True)
        (folder / "run.json").touch()
    offered("fish", "msgdrop diff ", monkeypatch)
    assert capsys.readouterr().out.split() == ["dcc", "md-0.2"]
    offered("fish", "msgdrop diff d", monkeypatch)
    assert capsys.readouterr().out.split() == ["dcc", "d9abcdef"]


def test_what_is_offered_for_a_sweep_has_a_setting() -> None:
    """A channel without one cannot run over a range."""
    assert {"loss:", "bursts:", "delay:"} <= set(completion.swept())
    assert not {"constant:", "own:", "shuffled:"} & set(completion.swept())


def test_published_policies_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where they lie in this repository."""
    monkeypatch.chdir(ROOT)
    published = ROOT / "results" / "published"
    there = {os.path.relpath(each.parent, ROOT) for each in published.rglob("policy.safetensors")}
    if not there:
        pytest.skip("the published records are not here")
    assert there <= set(completion.runs())
