"""What is built to be installed works without the repository, and says what it has not."""

import os
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

import msgdrop_cli
from msgdrop_cli.definition.pages import METRICS, VERDICTS
from tests.cli_runs import ROOT, Said

pytestmark = pytest.mark.slow
pytest.importorskip("hatchling")


class Built(NamedTuple):
    """A wheel, unpacked as pip would install it, and the names in the sdist."""

    site: Path
    sdist: Sequence[str]
    elsewhere: Path
    """An empty folder."""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Both are built of this checkout."""
    folder = tmp_path_factory.mktemp("built")
    build = [sys.executable, "-m", "hatchling", "build", "-d", str(folder), "-t", "wheel"]
    subprocess.run([*build, "-t", "sdist"], cwd=ROOT, check=True, capture_output=True, timeout=120)
    [wheel], [sdist] = folder.glob("*.whl"), folder.glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    with tarfile.open(sdist) as archive:
        names = [name.partition("/")[2] for name in archive.getnames()]
    (folder / "elsewhere").mkdir()
    return Built(folder / "site", names, folder / "elsewhere")


def run(built: Built, *arguments: str) -> Said:
    """A command of the wheel, in a folder without anything."""
    done = subprocess.run(
        [sys.executable, "-m", "msgdrop_cli", *arguments],
        cwd=built.elsewhere,
        env={**os.environ, "PYTHONPATH": str(built.site)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    return Said(done.returncode, done.stdout, done.stderr)


def test_it_is_this_version_and_not_this_checkout(built: Built) -> None:
    """Or the tests below would say nothing."""
    assert run(built, "--version").out == f"msgdrop {msgdrop_cli.__version__}\n"
    code = "import msgdrop_cli, msgdrop_envs, msgdrop_ablations as a; print(msgdrop_cli.__file__)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=built.elsewhere,
        env={**os.environ, "PYTHONPATH": str(built.site)},
        capture_output=True,
        text=True,
    )
    assert done.stdout.startswith(str(built.site))


@pytest.mark.parametrize("command", ["reproduce", "verify", "status", "eval", "plot", "export"])
def test_it_says_that_it_carries_no_records(built: Built, command: str) -> None:
    """And where they are; nothing is written."""
    said = run(built, command)
    assert (said.code, said.out) == (2, "")
    assert "published ones lie in results/published of the repository" in said.err
    assert list(built.elsewhere.iterdir()) == []


def test_it_has_all_questions_and_kernels(built: Built) -> None:
    """What is no Python is in it, too: TOML, C, pages, the register of the paper."""
    said = run(built, "ablate", "figure-3b", "--profile", "paper", "--dry-run")
    assert said.code == 0, said.err
    shipped = {path.relative_to(built.site).as_posix() for path in built.site.rglob("*")}
    for root, package in (("", "msgdrop_cli"), ("ablations", "msgdrop_ablations")):
        for path in (ROOT / root / package).rglob("*"):
            if path.suffix in {".toml", ".c", ".h", ".html", ".css", ".js"}:
                assert path.relative_to(ROOT / root).as_posix() in shipped
    assert {
        "msgdrop_cli/PAPER.md",
        *(f"msgdrop_cli/{each}" for each in (METRICS, VERDICTS)),
    } <= shipped
    assert "wall_time_s: metric" in run(built, "explain", "wall_time_s").out


def test_the_sdist_can_be_built_and_tested(built: Built) -> None:
    """With its tests and pins; the published numbers stay in the repository."""
    wanted = {
        *("pyproject.toml", "constraints.txt", "Makefile", "PAPER.md", METRICS, VERDICTS),
        "tests/test_wheel.py",
    }
    assert wanted <= set(built.sdist)
    assert not any(name.startswith("results/") for name in built.sdist)
