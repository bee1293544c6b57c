"""What the Makefile promises in its first lines."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make here")
@pytest.mark.parametrize("target", ["demo", "test", "docs", "bench"])
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
