"""Where outputs may go: what people name is made, and nothing beside it."""

from pathlib import Path

import pytest

from tests.cli_runs import Store, filled_store, msgdrop


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs."""
    return filled_store(tmp_path_factory.mktemp("cli"))


def test_folders_that_nobody_has_named_are_not_made(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is named is made; a folder that it lies in must be there, whatever is written."""
    monkeypatch.chdir(tmp_path)
    run = next(store.results.glob("runs/*/dcc-s1-*"))
    for option, *command in (
        ("--results", "train", "--dry-run"),
        ("--results", "ablate", store.question),
        ("--results", "import", "a.zip"),
        ("--to", "publish", store.question, "--results", store.results),
        ("--into", "mirror", store.results),
        ("--gif", "replay", run),
        ("--html", "replay", run),
        ("--mp4", "replay", run),
    ):
        said = msgdrop(*command, option, "no/such/place")
        assert (said.code, said.out) == (73, "")
        line = (
            f"{option}: no/such/place: cannot be created: no/such is not there (mkdir -p no/such)"
        )
        assert said.err == f"msgdrop: error: {line}\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("option", "command"),
    [
        ("--results", ["train", "--dry-run"]),
        ("--into", ["mirror"]),
        ("--gif", ["replay", "x"]),
        ("[RESULTS]", ["status"]),
        ("RUN", ["replay"]),
    ],
)
def test_no_path_is_none(option: str, command: list[str]) -> None:
    """An unset variable of a shell does not mean the folder we are in."""
    said = msgdrop(*command, *([option] if option.startswith("-") else []), "")
    assert said.code == 2
    assert said.err.startswith(f"msgdrop: error: {option}: expected a path, not ''")
