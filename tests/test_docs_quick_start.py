"""docs/quick-start.md: what it says to type is typed, one line after the other."""

import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.cli_runs import ROOT, Said, msgdrop
from tests.markdown import page

PAGE = page("quick-start.md")
STUDY = Path("results/published/broken-links-two-million")


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the one study that the page asks."""
    folder = tmp_path_factory.mktemp("clone")
    shutil.copytree(ROOT / STUDY, folder / STUDY, ignore=shutil.ignore_patterns("figures"))
    return folder


def bytes_of(folder: Path) -> dict[Path, bytes]:
    """Every file in it."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def said(clone: Path) -> dict[str, Said]:
    """What each command did, by its name, in the page's order."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(clone)
        lines = [shlex.split(line)[1:] for line in PAGE.commands()]
        return {line[0] + "-dry" * ("--dry-run" in line): msgdrop(*line) for line in lines}


@pytest.mark.slow
def test_every_command_works(said: dict[str, Said]) -> None:
    """Nine of them, all with exit code 0."""
    assert [(name, each.err) for name, each in said.items() if each.code] == []
    names = ["status", "explain", "ablate", "unstable-test", "plot", "replay", "train", "eval"]
    assert list(said) == [*names, "ablate-dry"]


@pytest.mark.slow
def test_they_show_what_the_page_promises(said: dict[str, Said], clone: Path) -> None:
    """Tables with verdicts, a figure, a page, references beside what was trained."""
    assert "supported" in said["unstable-test"].out
    assert (clone / said["plot"].out.splitlines()[-1]).is_file()
    assert "<html" in (clone / "results/figures/episode.html").read_text()
    assert "(random)" in said["train"].out
    assert "(scripted)" in said["train"].out
    assert "loss 0.2" in said["eval"].out
    assert said["ablate-dry"].out.count("\ntime ") == 1


@pytest.mark.slow
def test_the_published_records_stay_as_they_are(said: dict[str, Said], clone: Path) -> None:
    """Everything is written beside them."""
    assert len(said) == 9
    now = {path.relative_to(clone): content for path, content in bytes_of(clone / STUDY).items()}
    assert now == {path: (ROOT / path).read_bytes() for path in now}


def test_the_policy_plays_in_a_loop_of_pettingzoo(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page's code, with the published policy; far above what doing nothing pays."""
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {}
    [code] = PAGE.code("python")
    exec(code, names)
    assert names["total"] > 0
