"""What the command line refuses: one line, the right exit code, nothing written."""

import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.commands.parts import words
from msgdrop_cli.engine import evaluation
from msgdrop_cli.errors import RecordError
from tests.cli_runs import Store, copied_store, filled_store, msgdrop

BAD_INPUT = [
    (["ablate", "blockwise-vs-elementwize"], "did you mean 'blockwise-vs-elementwise'?"),
    (["ablate", "no/such.toml"], "no/such.toml: cannot be read"),
    (["ablate", "QUESTION", "--profile", "quik"], "did you mean 'quick'?"),
    (["ablate", "QUESTION", "--set", "algorithm.rte=0.3"], "did you mean 'rate'?"),
    (["ablate", "QUESTION", "--set", "gamma=0.9"], "begins with its section: algorithm.gamma"),
    (["ablate", "--set", "help"], "--set: of which question?"),
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
    (
        ["eval", "--broken-links", "nan"],
        "no channel is called 'nan'; known: all, bursts, constant",
    ),
    (["eval", "--broken-links", "130%"], "--broken-links: expected"),
    (["eval", "--broken-links", "%"], "--broken-links: expected"),
    (["eval", "--episodes", "0"], "--episodes: expected"),
    (["eval", "--episodes", "1.5"], "--episodes: expected a whole number such as 1000"),
    (["train", "--rate", "3"], "--rate: expected a share from 0 to 1"),
    (["train", "--rate", "30%", "--set", "algorithm.rate=0.3"], "give one of both"),
    (["train", "--rate", "0.3", "--set", "variants.dcc-md.algorithm.rate=0.5"], "give one of both"),
    (["train", "--steps", "3000", "--set", "training . train_env_steps=9"], "give one of both"),
    (["train", "--algorithm", "dcc", "--rate", "0.3"], "dcc means rate 0; these take one: dcc-md"),
    (["train", "--steps", "0"], "--steps: expected at least 1"),
    (["train", "--steps", "1e5", "--set", "training.train_env_steps=9"], "give one of both"),
    (["train", "--seed", "0"], "--seed: a seed lies between 1"),
    (["train", "--seed", "3", "--seeds", "3"], "give one of them"),
    (["train", "--seed", "1,2"], "--seed: expected a whole number"),
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


def test_a_name_that_is_too_long_is_refused(store: Store, tmp_path: Path) -> None:
    """A results folder of 300 letters cannot be created: 73, in one line."""
    said = store._replace(results=tmp_path / ("x" * 300)).ablate()
    assert said.code == 73
    assert said.err.splitlines()[-1].endswith("cannot be created: File name too long")


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
    monkeypatch.setattr(words, "channel", lambda *_: 1 / 0)
    said = msgdrop("eval")
    assert said.code == 1
    assert said.err == (
        "msgdrop: error: ZeroDivisionError: division by zero "
        "(this is a bug in msgdrop; MSGDROP_TRACEBACK=1 shows it)\n"
    )


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        ImportError("libtorch.so: failed to map segment from shared object"),
        RuntimeError("can't start new thread"),
        SystemError("error return without exception set"),
        OSError(12, "Cannot allocate memory"),
    ],
)
def test_a_lack_of_memory_is_called_so(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also if something else was made of it: no setting is too large, nothing is a bug of ours."""

    def lacking(*_: object) -> None:
        raise RuntimeError("something else") from error

    monkeypatch.setattr(words, "channel", lacking)
    said = msgdrop("eval", "--broken-links", "half")
    assert (said.code, said.out) == (74, "")
    assert said.err.startswith("msgdrop: error: memory is short: "), said.err


def test_no_folder_for_temporary_files_is_no_bug(monkeypatch: pytest.MonkeyPatch) -> None:
    """What to do is said."""

    def nowhere(*_: object) -> None:
        raise FileNotFoundError(2, "No usable temporary directory found in ['/tmp']")

    monkeypatch.setattr(words, "channel", nowhere)
    said = msgdrop("eval", "--broken-links", "half")
    assert (said.code, said.err.count("\n")) == (74, 1)
    assert said.err.endswith("found in ['/tmp']; name a folder in TMPDIR\n")


def test_a_damaged_policy_costs_only_its_run(copy: Store) -> None:
    """`eval` names the bad run in one line, shows the others' table, and exits with 2."""
    policy = sorted(copy.results.rglob("policy.safetensors"))[0]
    policy.write_bytes(policy.read_bytes()[:1000])
    said = msgdrop("eval", copy.results, "--episodes", "9", "--workers", "1")
    assert said.code == 2
    assert [str(policy) in line for line in said.err.splitlines()].count(True) == 1
    shown = json.loads(msgdrop("eval", copy.results, "--episodes", "9", "--json").out)["results"]
    assert {row["variant"]: row["done"] for row in shown} == {"dcc": 1, "md-0.2": 2}


def test_episodes_that_cannot_be_written_are_74(
    copy: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full disk during an evaluation is a full disk to the caller, too."""

    def full(path: Path, rows: object) -> None:
        raise RecordError(f"{path}: cannot be written: No space left on device", 74)

    monkeypatch.setattr(evaluation, "write_listed", full)
    said = msgdrop("eval", copy.results, "--episodes", "9", "--workers", "1")
    assert said.code == 74
    assert said.err.count("No space left on device") == 4


def test_a_lost_policy_says_what_to_do(copy: Store) -> None:
    """A finished run without policy and episodes is named with the way out; the others count."""
    policy = sorted(copy.results.rglob("policy.safetensors"))[0]
    policy.unlink()
    (policy.parent / "episodes.jsonl").unlink()
    said = copy.ablate()
    assert said.code == 2
    lines = [line for line in said.err.splitlines() if str(policy.parent) in line]
    assert len(lines) == 1
    assert lines[0].endswith("delete this folder and train the run again")
    assert said.out.count("DCC") >= 2
    document = json.loads(copy.ablate("--json").out)
    assert {row["variant"]: row["done"] for row in document["results"]} == {"dcc": 1, "md-0.2": 2}


def _set(key: str, value: Any) -> Callable[[Path], object]:
    """Puts a value at `a.b` of a run's record."""

    def change(path: Path) -> None:
        record = table = json.loads((path / "run.json").read_text())
        *way, last = key.split(".")
        for step in way:
            table = table[step]
        table[last] = value
        (path / "run.json").write_text(json.dumps(record))

    return change


def _without_spec(path: Path) -> None:
    _set("spec", {})(path)
    _set("wall_time_s", 5.0)(path)  # long enough to learn a speed from


def _rows(name: str, text: str) -> Callable[[Path], object]:
    return lambda path: (path / name).write_text(text)


FOREIGN = [
    (_set("spec.training", []), ["status"], 0),
    (_set("spec.training", None), ["status"], 0),
    (_without_spec, ["status", "ablate"], 0),
    (_set("wall_time_s", 10**400), ["status", "plot", "eval", "ablate"], 2),
    (_set("metrics", [1]), ["plot", "eval"], 2),
    (_set("metrics", {"a": 1}), ["plot", "eval"], 2),
    (_rows("episodes.jsonl", '{"broken_links": 0.0, "steps": 3}\n'), ["plot", "eval"], 2),
    (_rows("episodes.jsonl", f'{{"broken_links": {10**400}}}\n'), ["plot", "eval"], 2),
    (_rows("metrics.jsonl", f'{{"env_steps": 1, "catches_per_500": {10**400}}}\n'), ["plot"], 2),
]


@pytest.mark.parametrize(("damage", "commands", "code"), FOREIGN)
def test_foreign_records_are_no_bugs_of_ours(
    damage: Callable[[Path], object], commands: Sequence[str], code: int, copy: Store
) -> None:
    """Whatever stands in a record: its path in one line and the code of damage, or an answer."""
    path = sorted(copy.results.rglob("run.json"))[0].parent
    damage(path)
    for command in commands:
        seeds = ("--seeds", "3", "--dry-run")
        said = copy.ablate(*seeds) if command == "ablate" else msgdrop(command, copy.results)
        assert said.code == code, (command, said.err)
        assert "bug in msgdrop" not in said.err
        if code:
            errors = [line for line in said.err.splitlines() if "error: " in line]
            assert len(errors) == 1
            assert str(path) in errors[0]


@pytest.mark.parametrize("more", [(), ("--dry-run",)])
def test_a_file_is_no_results_folder(tmp_path: Path, more: Sequence[str]) -> None:
    """A dry run says so, too: what it shows could not be trained."""
    (tmp_path / "taken").touch()
    said = msgdrop("train", "--results", tmp_path / "taken", *more)
    assert (said.code, said.out) == (73, "")
    assert said.err.endswith("taken: is a file; name a folder\n")
