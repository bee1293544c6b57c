"""What the Makefile promises in its first lines."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine.offers import catalogue

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make here")
@pytest.mark.parametrize("target", ["demo", "test", "docs", "faults", "bench"])
def test_what_lasts_stays_in_this_folder(target: str) -> None:
    """Whatever runs our code keeps its caches in `.cache`; what installs it keeps pip's own."""
    done = subprocess.run(
        ["make", "--dry-run", "--always-make", target],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=30,
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith((".venv/bin/", "XDG_"))]
    ours = [line for line in lines if "-m pip" not in line]
    inside = f'XDG_CACHE_HOME="{ROOT}/.cache" MPLCONFIGDIR="{ROOT}/.cache/matplotlib" '
    assert ours
    assert all(line.startswith(inside) for line in ours)
    assert all(line.startswith(".venv/bin/python -m pip") for line in set(lines) - set(ours))


def test_the_demo_takes_minutes_and_claims_nothing() -> None:
    """At the speeds of `make bench` (NOTES.md) 300,000 env steps of six runs are 130 s on 2 cores.

    Two seeds decide nothing, so it must not end in verdicts.
    """
    [demo] = re.findall(r"msgdrop ablate (\S+\.toml)$", (ROOT / "Makefile").read_text(), re.M)
    question = load_definition(str(ROOT / demo))
    made = plan(question, "quick", catalogue())
    assert question.claims == ()
    assert sorted({run.variant for run in made.runs}) == ["dcc", "fdc", "md-0.2"]
    assert sum(run.spec.training.train_env_steps for run in made.runs) == 1_800_000
