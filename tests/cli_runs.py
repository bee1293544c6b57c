"""Runs the command line in the tests, and a results folder that it filled."""

import contextlib
import io
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from msgdrop_cli import app

ROOT = Path(__file__).resolve().parents[1]
QUESTION = """
title = "A tiny question"
question = "Does everything run?"
source = "nobody"
environments = ["pursuit-n6"]
[variants.dcc]
label = "DCC [/red]"
algorithm = { name = "dcc" }
[variants."md-0.2"]
label = "DCC-MD 0.2"
algorithm = { name = "dcc-md", rate = 0.2 }
[profiles.quick]
seeds = 2
evaluation_episodes = 8
training = { train_env_steps = 200, games = 4, log_every_env_steps = 50 }
algorithm = { replay_capacity = 400, replay_start_env_steps = 100 }
environment = { time_limit = 40 }
[[claims]]
says = "Message-dropout is better"
source = "l. 1"
better = "md-0.2"
worse = "dcc"
environment = "pursuit-n6"
metric = "catches_per_500"
"""


class Said(NamedTuple):
    """What one command line did."""

    code: int
    out: str
    err: str


def msgdrop(*arguments: str | Path) -> Said:
    """Run a command line in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = app.run([str(each) for each in arguments])
    return Said(code, out.getvalue(), err.getvalue())


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python on the checkout, in a process of its own."""
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "envs", "ablations"))
    return subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=60,
    )


class Store(NamedTuple):
    """A results folder, the question that filled it, and what was said on the way."""

    question: Path
    results: Path
    said: Said

    def ablate(self, *arguments: str | Path) -> Said:
        """Ask the question (again)."""
        where = ("--results", self.results, "--workers", "1")
        return msgdrop("ablate", self.question, *where, *arguments)


def filled_store(folder: Path, text: str = QUESTION) -> Store:
    """A results folder with four tiny runs of a question, trained here and now."""
    question = folder / "tiny.toml"
    question.write_text(text)
    empty = Store(question, folder / "results", Said(0, "", ""))
    return empty._replace(said=empty.ablate())


def copied_store(store: Store, folder: Path) -> Store:
    """The same in another folder, to be changed."""
    shutil.copytree(store.results, folder / "results")
    return store._replace(results=folder / "results")
