"""What the TAB key offers in each shell, and the runs that it finds."""

import os
from pathlib import Path

import pytest

from msgdrop_cli import app
from msgdrop_cli.commands.parts import completion
from tests.cli_runs import ROOT


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


def test_published_policies_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where they lie in this repository."""
    monkeypatch.chdir(ROOT)
    published = ROOT / "results" / "published"
    there = {os.path.relpath(each.parent, ROOT) for each in published.rglob("policy.safetensors")}
    if not there:
        pytest.skip("the published records are not here")
    assert there <= set(completion.runs())
