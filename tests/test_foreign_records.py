"""Values in records are data: whatever stands in one, `status` and `plot` answer in words."""

import copy
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine import play_references
from msgdrop_cli.engine.facts import facts
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.records.files import append_jsonl
from msgdrop_cli.records.store import EPISODES, METRICS, RUN, create_run, run_path, set_status
from msgdrop_cli.report.drawn import Drawn
from msgdrop_envs import registry
from tests.cli_runs import msgdrop

Key = str | int
HUGE, LARGEST = 10**18, 2**63 - 1
WRONG: list[Any] = [
    *(None, True, "x", "", [], {"a": 1}, -1, 0, 3, 0.5, 1e-300, 1e300),
    *(HUGE, -HUGE, LARGEST, "x" * 900, "../../x"),
]


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures that are laid out and not painted, and reference policies that play once."""
    monkeypatch.setattr(play_references, "EPISODES", 1)
    monkeypatch.setattr(Drawn, "picture", lambda drawn, suffix: b"")


@pytest.fixture
def record(tmp_path: Path) -> Path:
    """One record of a folder whose real runs allow every figure, to be changed."""
    short = ["environment.time_limit=10"]
    asked = plan(
        load_definition("dropout-rate"), "quick", catalogue(), overrides=short, seeds=(1, 2)
    )
    made = []
    for run in asked.runs[:6]:
        path, steps = run_path(tmp_path, run), run.spec.training.train_env_steps
        env = registry.make(run.spec.environment_config)
        create_run(path, run, facts(env, "c", "cpu"))
        set_status(path, "done", env_steps=steps)
        every = run.spec.training.log_every_env_steps
        ends = range(every, steps + 1, every)
        windows = ({"env_steps": end, "catches_per_500": 3 * end / steps} for end in ends)
        append_jsonl(path / METRICS, *windows)
        counts = {"steps": 9, "finished": False, "return": -1.0, "catches": 1, "edge_hits": 2}
        played = ({"broken_links": links, "episode": 0, **counts} for links in (0.0, 0.5))
        append_jsonl(path / EPISODES, *played)
        made.append(path / RUN)
    return made[0]


def places(value: Any, at: tuple[Key, ...] = ()) -> Iterator[tuple[Key, ...]]:
    """The keys that lead to every value of a record, tables and lists included."""
    if at:
        yield at
    pairs: Any = ()
    if isinstance(value, dict | list):
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
    for key, entry in pairs:
        yield from places(entry, (*at, key))


def changed(good: Any, at: tuple[Key, ...], wrong: Any) -> str:
    """The record with another value in one place."""
    run = copy.deepcopy(good)
    table = run
    for key in at[:-1]:
        table = table[key]
    table[at[-1]] = wrong
    return json.dumps(run)


def check(record: Path, *arguments: str, commands: Sequence[str] = ("status", "plot")) -> None:
    """`status` and `plot` are done (0), or say in one line what they cannot read (2)."""
    root = record.parents[3]
    for command in commands:
        said = msgdrop(command, root, *arguments)
        assert said.code in (0, 2), said.err
        errors = [line for line in said.err.splitlines() if "error: " in line]
        assert len(errors) == (said.code == 2), said.err
        assert "Warning" not in said.err


def test_no_value_in_a_record_is_a_bug_of_ours(record: Path) -> None:
    """Every place of a real record holds a wrong value once, another one than its neighbours.

    `status` reads all of them, `plot` every second: all seventeen in all places are 5,529 command
    lines and half an hour, and were tried by hand.
    """
    good = json.loads(record.read_text())
    assert msgdrop("plot", record.parents[3]).out.count(".png") == 5
    for number, at in enumerate(places(good)):
        record.write_text(changed(good, at, WRONG[number % len(WRONG)]))
        check(record, commands=("status", "plot")[: 1 + number % 2])


ENVIRONMENT, ALGORITHM = ("spec", "environment"), ("spec", "algorithm")


def traps(at: tuple[Key, ...], *wrong: Any) -> list[tuple[tuple[Key, ...], Any]]:
    """One place, and what must not stand there."""
    return [(at, each) for each in wrong]


KNOWN = [
    *traps((*ALGORITHM, "rate"), "x", [], HUGE, 1e300, -1, True),
    *traps((*ENVIRONMENT, "name"), "x" * 900, "../../x", []),
    *traps((*ENVIRONMENT, "map_size"), HUGE, LARGEST, 10**6),
    *traps((*ENVIRONMENT, "sight"), HUGE, LARGEST, 10**4),
    *traps((*ENVIRONMENT, "time_limit"), HUGE, 10**6),
    *traps(("spec", "training", "train_env_steps"), 0, -1, LARGEST),
]


@pytest.mark.parametrize(("at", "wrong"), KNOWN, ids=lambda value: str(value)[:30])
def test_a_known_trap_is_no_bug_of_ours(record: Path, at: tuple[Key, ...], wrong: Any) -> None:
    """The places from which numbers go into games, axes and names of files."""
    record.write_text(changed(json.loads(record.read_text()), at, wrong))
    check(record)


@pytest.mark.parametrize("size", ["map_size", "sight", "time_limit"])
def test_a_game_too_large_to_play_has_no_reference_policies(record: Path, size: str) -> None:
    """A note names the record; the figures are drawn without its lines."""
    changes = changed(json.loads(record.read_text()), (*ENVIRONMENT, size), HUGE)
    record.write_text(changes)
    said = msgdrop("plot", record.parents[3])
    assert said.code == 0, said.err
    note = f"{record}: spec.environment: the game is too large to be played here; "
    assert sum(line.startswith(note) for line in said.err.splitlines()) == 1


@pytest.mark.parametrize("log", [METRICS, EPISODES])
@pytest.mark.parametrize("value", [1e101, 1e308, -1e308, LARGEST, "x", None, True])
def test_no_value_in_a_log_is_a_bug_of_ours(record: Path, log: str, value: Any) -> None:
    """Sums over seeds of what is measured stay finite, or a log is named."""
    files = [path.with_name(log) for path in record.parents[1].glob(f"*/{RUN}")]
    good = [json.loads(line) for line in files[0].read_text().splitlines()]
    for key in good[0]:
        rows = "".join(json.dumps(row | {key: value}) + "\n" for row in good)
        for file in files:
            file.write_text(rows)
        check(record, "--json")


def test_metrics_without_number_are_refused(record: Path) -> None:
    """Each would cost an interval."""
    run = json.loads(record.read_text())
    metric = next(iter(run["metrics"].values()))
    record.write_text(json.dumps(run | {"metrics": {f"m{n}": metric for n in range(33)}}))
    said = msgdrop("plot", record.parents[3])
    assert said.code == 2
    assert "run.json: metrics: expected 32 metrics at most, not 33" in said.err
