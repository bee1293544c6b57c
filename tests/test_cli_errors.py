"""What the command line refuses: one line, the right exit code, nothing written."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from msgdrop_cli.commands import words
from tests.cli_runs import Store, copied_store, filled_store, msgdrop

BAD_INPUT = [
    (["ablate", "blockwise-vs-elementwize"], "did you mean 'blockwise-vs-elementwise'?"),
    (["ablate", "no/such.toml"], "no/such.toml: cannot be read"),
    (["ablate", "QUESTION", "--profile", "quik"], "did you mean 'quick'?"),
    (["ablate", "QUESTION", "--set", "algorithm.rte=0.3"], "did you mean 'rate'?"),
    (["ablate", "QUESTION", "--set", "algorithm.rate=high"], "expected a finite number"),
    (["ablate", "QUESTION", "--set", "algorithm.rate=1.5"], "between 0 and 1"),
    (["ablate", "QUESTION", "--seeds", "0"], "expected 1 to 1000 seeds"),
    (["ablate", "QUESTION", "--workers", "0"], "--workers: expected 1 to 256"),
    (["ablate", "QUESTION", "--workers", "many"], "many"),
    (["ablate", "QUESTION", "--device", "gpu"], "--device: 'gpu' is unknown"),
    (["ablate", "QUESTION", "--frobnicate"], "--frobnicate"),
    (["train", "--env", "pursuit-n7"], "did you mean 'pursuit-n"),
    (["train", "--algorithm", "dcc-mb"], "did you mean 'dcc-md'?"),
    (["train", "--profile", "[/red]"], "'[/red]'"),
    (["eval", "--broken-links", "1.5"], "--broken-links: expected"),
    (["eval", "--broken-links", "nan"], "--broken-links: expected"),
    (["eval", "--episodes", "0"], "--episodes: expected"),
    (["eval", "nowhere"], "nowhere"),
    (["plot", "nowhere"], "nowhere"),
    (["status", "nowhere"], "nowhere"),
    (["unstable-test", "nowhere"], "nowhere"),
    (["evaluate"], "evaluate"),
]


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs, trained once; tests that change them take `copy`."""
    return filled_store(tmp_path_factory.mktemp("cli"))


@pytest.fixture
def copy(store: Store, tmp_path: Path) -> Store:
    """The same, to be changed."""
    return copied_store(store, tmp_path)


@pytest.mark.parametrize(("arguments", "expected"), BAD_INPUT)
def test_bad_input_is_one_line(
    arguments: Sequence[str],
    expected: str,
    store: Store,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Bad input exits with 2 after one line that names it, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    said = msgdrop(*(store.question if each == "QUESTION" else each for each in arguments))
    assert (said.code, said.out) == (2, "")
    assert said.err.startswith("msgdrop: error: ")
    assert said.err.count("\n") == 1
    assert expected in said.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["eval", "unstable-test", "plot", "status"])
def test_foreign_folders_are_refused(command: str, tmp_path: Path) -> None:
    """A folder without runs is the user's mistake, said in one line."""
    (tmp_path / "holiday.txt").write_text("sun")
    said = msgdrop(command, tmp_path)
    assert said.code == 2
    assert said.err == (
        f"msgdrop: error: {tmp_path}: holds no runs of msgdrop (no run.json in or below)\n"
    )


@pytest.mark.parametrize("command", ["eval", "unstable-test", "plot", "status"])
def test_damaged_records_are_refused(command: str, copy: Store) -> None:
    """A damaged record is named, in one line."""
    record = next(copy.results.rglob("run.json"))
    record.write_text("{")
    said = msgdrop(command, copy.results)
    assert said.code == 2
    assert said.err.startswith(f"msgdrop: error: {record}: is damaged")
    assert said.err.count("\n") == 1


def test_results_that_cannot_be_created_are_refused(store: Store, tmp_path: Path) -> None:
    """A results folder below a file is refused with 73 before anything is trained."""
    (tmp_path / "file").write_text("")
    said = store._replace(results=tmp_path / "file" / "results").ablate()
    assert said.code == 73
    assert "cannot be created" in said.err.splitlines()[-1]


def test_a_full_disk_is_refused(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Too little disk is refused with 74, in bytes needed and free."""
    usage = shutil.disk_usage(tmp_path)._replace(free=1_000)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    said = store._replace(results=tmp_path / "results").ablate()
    assert said.code == 74
    assert "1,000 bytes" in said.err.splitlines()[-1]
    assert list((tmp_path / "results").iterdir()) == []


def test_our_own_mistakes_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """An unexpected exception is called a bug, exits with 1 and shows no traceback."""
    monkeypatch.setattr(words, "broken_links", lambda text: 1 / 0)
    said = msgdrop("eval")
    assert said.code == 1
    assert said.err == (
        "msgdrop: error: ZeroDivisionError: division by zero "
        "(this is a bug in msgdrop; MSGDROP_TRACEBACK=1 shows it)\n"
    )
