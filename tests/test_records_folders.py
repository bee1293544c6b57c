"""A results folder that also holds other people's things: they are passed over, with one note."""

import json
import os
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.engine import play_references
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.folders import run_folders
from msgdrop_cli.records.store import RunRecord, find_run, list_runs
from tests.cli_runs import msgdrop
from tests.fake_runs import write_run

SACRED: dict[str, object] = {
    "artifacts": [],
    "command": "my_main",
    "status": "COMPLETED",
    "result": None,
}


@pytest.fixture
def run(tmp_path: Path) -> RunRecord:
    """One run of ours, beside which other things will stand."""
    return write_run(tmp_path, "dcc", 1, catches={0.0: 3})


def sacred(folder: Path, content: str = json.dumps(SACRED)) -> Path:
    """Somebody else's record, as Sacred writes it."""
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(content)
    return folder / "run.json"


@pytest.mark.parametrize("content", [json.dumps(SACRED), "[]", "{", '{"schema": "https://x"}'])
def test_a_foreign_record_is_passed_over(tmp_path: Path, run: RunRecord, content: str) -> None:
    """What neither is called like a run nor says that it is one is none of ours."""
    sacred(tmp_path / "qmix" / "1", content)
    assert list_runs(tmp_path) == [run]
    assert run_folders(tmp_path).passed_over == ("qmix/1/run.json (not of msgdrop)",)


def test_runs_beside_and_below_a_foreign_record_are_found(tmp_path: Path, run: RunRecord) -> None:
    """A folder with somebody's record is a folder like any other."""
    (tmp_path / "run.json").write_text(json.dumps(SACRED))
    assert list_runs(tmp_path) == [run]


def test_a_run_under_another_name_is_ours(tmp_path: Path, run: RunRecord) -> None:
    """Its record says so: a copy keeps counting whatever its folder is called."""
    run.path.rename(tmp_path / "best")
    assert [each.run for each in list_runs(tmp_path)] == [run.run]


@pytest.mark.parametrize("content", ["", "{", "[]", json.dumps(SACRED)])
def test_damage_in_a_folder_of_ours_is_an_error(
    tmp_path: Path, run: RunRecord, content: str
) -> None:
    """What is called like a run is one, and nobody's numbers go missing in silence."""
    (run.path / "run.json").write_text(content)
    with pytest.raises(RecordError) as caught:
        list_runs(tmp_path)
    assert str(caught.value).startswith(f"{run.path / 'run.json'}: ")


@pytest.mark.parametrize("target", ["runs", "link", "nowhere"])
def test_links_are_passed_over(tmp_path: Path, run: RunRecord, target: str) -> None:
    """To a folder of runs, which would count them twice, to themselves, or to nothing."""
    (tmp_path / "link").symlink_to(tmp_path / target)
    assert list_runs(tmp_path) == [run]
    assert find_run(tmp_path, run.run_id) == run
    assert run_folders(tmp_path).passed_over == ("link (a link)",)


def test_a_link_to_a_run_is_not_followed(tmp_path: Path, run: RunRecord) -> None:
    """Even under a run's name: what is read has to stand here."""
    elsewhere = tmp_path / "elsewhere" / run.path.name
    elsewhere.parent.mkdir()
    run.path.rename(elsewhere)
    run.path.symlink_to(elsewhere)
    assert [each.path for each in list_runs(tmp_path)] == [elsewhere]


def test_links_to_files_are_nothing_to_tell(tmp_path: Path, run: RunRecord) -> None:
    """A file is no run, wherever it stands."""
    (tmp_path / "notes").write_text("")
    (tmp_path / "README").symlink_to(tmp_path / "notes")
    assert run_folders(tmp_path) == ((run.path,), ())


def test_a_closed_folder_is_passed_over(
    tmp_path: Path, run: RunRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`lost+found` belongs to root."""
    (tmp_path / "lost+found").mkdir()
    scandir = os.scandir

    def closed(path: Any) -> Any:
        if Path(path).name == "lost+found":
            raise PermissionError(13, "Permission denied", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", closed)
    assert run_folders(tmp_path) == ((run.path,), ("lost+found (Permission denied)",))


def test_a_folder_that_goes_while_we_look_is_nothing_to_tell(
    tmp_path: Path, run: RunRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Training and importing remove folders at any time."""
    (tmp_path / "gone").mkdir()
    scandir = os.scandir

    def going(path: Any) -> Any:
        if Path(path).name == "gone":
            raise FileNotFoundError(2, "No such file or directory", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", going)
    assert run_folders(tmp_path) == ((run.path,), ())


def test_one_note_names_some_and_counts_the_others(tmp_path: Path, run: RunRecord) -> None:
    """A thousand foreign records do not fill the screen, and the table is as it was."""
    before = msgdrop("status", tmp_path)
    for number in range(1, 6):
        sacred(tmp_path / "qmix" / str(number))
    said = msgdrop("status", tmp_path)
    named = ", ".join(f"qmix/{number}/run.json (not of msgdrop)" for number in (1, 2, 3))
    assert said == (0, before.out, f"{tmp_path}: passed over: {named} and 2 more\n")


@pytest.mark.parametrize("command", ["plot", "eval"])
def test_other_commands_pass_over_the_same(
    tmp_path: Path, run: RunRecord, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the same note, once."""
    monkeypatch.setattr(play_references, "EPISODES", 1)
    sacred(tmp_path / "qmix" / "1")
    more = ("--episodes", "2") if command == "eval" else ()
    said = msgdrop(command, tmp_path, *more)
    assert said.code == 0, said.err
    assert said.err.count("passed over: qmix/1/run.json (not of msgdrop)") == 1


def test_a_folder_of_others_only_says_what_is_there(tmp_path: Path) -> None:
    """The error says why a folder that does not look empty holds no runs."""
    sacred(tmp_path / "qmix" / "1")
    said = msgdrop("status", tmp_path)
    assert (said.code, said.out) == (2, "")
    assert "holds no runs of msgdrop (passed over: qmix/1/run.json (not of msgdrop))" in said.err


def test_a_missing_folder_says_where_runs_come_from(tmp_path: Path) -> None:
    """Who has installed a wheel has neither own runs nor the published ones."""
    with pytest.raises(RecordError, match="no such folder; msgdrop ablate makes runs there"):
        run_folders(tmp_path / "results")
