"""What happens before anything is trained: quickly, and nowhere but in the results folder."""

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import pytest

from msgdrop_cli.engine import facts
from msgdrop_cli.kernels.build import why_torch
from msgdrop_envs import registry
from tests.cli_runs import ROOT
from tests.processes import TINY

_PLANS = """
import sys
from msgdrop_cli.app import run
from msgdrop_cli.definition.load import list_definitions

def tell(after):
    print("loaded", after, *sorted({"torch._dynamo", "sympy"} & sys.modules.keys()))

for question in list_definitions():
    assert run(["ablate", question, "--dry-run"]) == 0
tell("by plans:")
assert run(sys.argv[1:]) == 0
tell("by training:")
"""


def test_no_compiler_is_loaded_to_count_bytes(tmp_path: Path) -> None:
    """Neither for the plans of all shipped questions nor to train: it costs a second, and a folder.

    Torch makes the folder in TMPDIR, also in workers. Where no kernel updates, torch.optim does,
    which loads its compiler by itself: there plans are all that can be told of.
    """
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
    sets = [word for each in TINY for word in ("--set", each)]
    done = subprocess.run(
        [sys.executable, "-c", _PLANS, "train", "--steps", "200", *sets],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": paths, "TMPDIR": str(temporary)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    told = [line for line in done.stdout.splitlines() if line.startswith("loaded ")]
    assert told[0] == "loaded by plans:"
    if not why_torch():
        assert told[1:] == ["loaded by training:"]
        assert list(temporary.iterdir()) == []
    assert (tmp_path / "results" / "runs").is_dir()


def test_the_checkout_is_only_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """To tell a run's commit, git need not write down what it has seen of the files."""

    def git(*words: str) -> None:
        name = ("-c", "user.name=n", "-c", "user.email=e")
        subprocess.run(["git", *name, *words], cwd=tmp_path, check=True, capture_output=True)

    source = tmp_path / "msgdrop_cli" / "engine" / "facts.py"
    source.parent.mkdir(parents=True)
    source.write_text("1")
    git("init")
    git("add", ".")
    git("commit", "-m", "one")
    os.utime(source, (1, 1))  # git would note that it is the same in spite of that
    index = tmp_path / ".git" / "index"
    before = index.read_bytes()
    monkeypatch.setattr(facts, "__file__", str(source))
    assert len(facts.commit() or "") == 40
    assert index.read_bytes() == before


@pytest.mark.parametrize(
    ("game", "setting"),
    [
        ("navigation-n8", "agents"),
        *(("waterworld-n8", each) for each in ("pursuers", "food", "poison", "sensors")),
        *(("pursuit-n6", each) for each in ("pursuers", "evaders")),
    ],
)
def test_a_mistyped_number_of_things_is_told_at_once(game: str, setting: str) -> None:
    """No tables of pairs are begun that take minutes and gigabytes."""
    with pytest.raises(ValueError, match=f"{setting}.* must be at most "):
        dataclasses.replace(registry.settings()[game], **{setting: 10_000})
