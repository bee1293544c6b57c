"""Records in Python: frames where pandas is, columns where it is not, the documented example."""

import re
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import msgdrop_cli
from msgdrop_cli.errors import RecordError
from tests.cli_runs import ROOT
from tests.fake_runs import write_run


def test_without_pandas_columns_are_lists(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each has a value for each row, None where a run has nothing."""
    monkeypatch.setitem(sys.modules, "pandas", None)
    write_run(tmp_path, "dcc", 1, catches={0.0: 3}, kernel="c-dcc", host="a machine")
    write_run(tmp_path, "dcc", 2, status="failed", reason="killed")
    table = msgdrop_cli.results(tmp_path)
    assert type(table) is dict
    assert {len(column) for column in table.values()} == {2}
    assert table["catches_per_500"] == [3.0, None]
    assert (table["kernel"], table["machine"]) == (["c-dcc", None], ["a machine", None])
    assert (table["status"], table["reason"]) == (["done", "failed"], [None, "killed"])


def test_with_pandas_they_are_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Made of the same columns, by whatever pandas is there."""
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=lambda c: ("frame", c)))
    write_run(tmp_path, "dcc", 1, curve=[1.0, 2.0])
    kind, columns = msgdrop_cli.curves(tmp_path)
    assert kind == "frame"
    assert columns["env_steps"] == [500, 1000]
    assert columns["catches_per_500"] == [1.0, 2.0]


def test_a_run_in_two_places_is_there_once(tmp_path: Path) -> None:
    """Published and local, as in every table and figure."""
    for folder in ("published", "mine"):
        write_run(tmp_path / folder, "dcc", 1, catches={0.0: 3})
    assert len(msgdrop_cli.results(tmp_path)["seed"]) == 1


def test_a_folder_without_runs_is_an_error(tmp_path: Path) -> None:
    """One line, as on the command line."""
    with pytest.raises(RecordError, match="holds no runs of msgdrop"):
        msgdrop_cli.results(tmp_path)


def test_the_documented_example_says_what_is_documented(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The example of docs/exports.md from a clone's folder, and its output below it."""
    monkeypatch.chdir(ROOT)
    text = (ROOT / "docs" / "exports.md").read_text()
    [code] = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(compile(code, "docs/exports.md", "exec"), {})
    assert f"# {capsys.readouterr().out}" == code.splitlines()[-1] + "\n"
