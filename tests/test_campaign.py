"""Campaigns: as much as fits into the time, the rest another time, the same results."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from itertools import count
from pathlib import Path

import pytest

from benchmarks import campaign, limited_time
from msgdrop_cli.commands.parts.shapes import Sizes
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine import run
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.records.archive import contents
from msgdrop_cli.records.files import run_lock
from msgdrop_cli.records.store import list_runs
from msgdrop_cli.stopping import Control, graceful_stop
from tests.cli_runs import QUESTION, ROOT, Store, filled_store, msgdrop
from tests.runs import digest


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """The question, answered by `ablate`."""
    return filled_store(tmp_path_factory.mktemp("campaign"))


@pytest.fixture(autouse=True)
def _commit_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tests run where there is no .git, too."""
    monkeypatch.setenv("MSGDROP_COMMIT", "0123456789" * 4)


def arguments(question: Path, out: Path, *more: str) -> list[str]:
    """A campaign of a minute."""
    given = [str(question), "--profile", "quick", "--out", str(out), "--workers", "1"]
    return [*given, "--minutes", "1", *more]


def state(out: Path) -> list[tuple[str, int, str]]:
    """Variant, seed and status of every run, as campaign.json says."""
    runs = json.loads((out / "campaign.json").read_text())["runs"]
    return [(each["variant"], each["seed"], each["status"]) for each in runs]


def test_cut_and_continued_is_as_ablate(
    store: Store,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Cut in its second run and continued, a campaign's archives hold what `ablate` trains."""
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        asked = count()
        patch.setattr(run, "_LOOK_UP_EVERY_S", 0.0)
        patch.setattr(Control, "stopping", lambda _: next(asked) > 75)
        assert campaign.main(arguments(store.question, out)) == 0
    assert state(out) == [
        ("dcc", 1, "done"),
        ("dcc", 2, "planned"),
        ("md-0.2", 1, "interrupted"),
        ("md-0.2", 2, "planned"),
    ]
    assert capsys.readouterr().out.count("evaluating") == 1
    assert len(contents(out / "tiny-quick-01.zip")) == 1
    assert campaign.main(arguments(store.question, out)) == 0
    assert {status for _, _, status in state(out)} == {"done"}

    said = msgdrop("import", *out.glob("*.zip"), "--results", tmp_path / "results")
    assert said.code == 0, said.err
    theirs = list_runs(store.results)
    ours = list_runs(tmp_path / "results")
    assert [record.run_id for record in ours] == [record.run_id for record in theirs]
    for one, other in zip(ours, theirs, strict=True):
        assert digest(one.path) == digest(other.path)
        assert one.episodes() == other.episodes()


def test_finished_campaign_does_nothing_again(store: Store, tmp_path: Path) -> None:
    """The same command once more trains nothing and writes no archive."""
    campaign.main(arguments(store.question, tmp_path, "--seeds", "1"))
    before = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*") if p.suffix in (".zip", ".json")}
    campaign.main(arguments(store.question, tmp_path, "--seeds", "1"))
    del before[tmp_path / "campaign.json"]
    assert len(before) == 3
    assert {path: path.stat().st_mtime_ns for path in before} == before


def test_time_stops_it(
    store: Store,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A run that is too long is interrupted with a checkpoint before the time is over."""
    monkeypatch.setattr(limited_time, "_NOTICE_S", 0.7)
    monkeypatch.setattr(limited_time, "measure", lambda *_: limited_time.Speeds(1e9, 1e9))
    began = time.monotonic()
    long = ("--set", "training.train_env_steps=5_000_000", "--seeds", "1")
    assert campaign.main([*arguments(store.question, tmp_path, *long), "--minutes", "0.06"]) == 0
    assert time.monotonic() - began < 3.6
    assert state(tmp_path) == [("dcc", 1, "interrupted"), ("md-0.2", 1, "planned")]
    [record] = list_runs(tmp_path)
    assert record.env_steps > 0
    assert list(record.path.glob("checkpoints/*/MANIFEST.json"))
    assert "0 packed" in capsys.readouterr().out


@pytest.mark.parametrize("speeds", [(1.0, 1e9), (1e9, 1.0)])
def test_end_is_given_the_time_it_needs(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, speeds: tuple[float, float]
) -> None:
    """Where a checkpoint or an archive would take longer than there is, nothing is begun."""
    monkeypatch.setattr(limited_time, "measure", lambda *_: limited_time.Speeds(*speeds))
    assert campaign.main(arguments(store.question, tmp_path)) == 0
    assert {status for _, _, status in state(tmp_path)} == {"planned"}


def test_moment_stops_one_phase_only() -> None:
    """What comes after a phase that ran out of its time still has its own; a signal ends all."""
    with graceful_stop() as control:
        with limited_time._stopped_at(control, time.monotonic()):
            while not control.stopping():
                pass
        assert not control.stopping()
        with limited_time._stopped_at(control, time.monotonic() + 60):
            os.kill(os.getpid(), signal.SIGTERM)
            assert control.stopping()
        assert control.stopping()


def test_fewer_checkpoints_are_the_same_runs(store: Store) -> None:
    """What a GPU's campaign trains is, by its ids, what everybody else trains."""
    definition = load_definition(str(store.question))
    asked = plan(definition, "quick", catalogue(), overrides=[campaign._NO_CHECKPOINTS])
    assert asked.runs[0].spec.training.checkpoint_every_env_steps == 1_000_000_000
    plain = plan(definition, "quick", catalogue())
    assert [run.run_id for run in asked.runs] == [run.run_id for run in plain.runs]


def test_machine_is_measured(tmp_path: Path) -> None:
    """Both speeds come from a file that is written and packed, and gone afterwards."""
    speeds = limited_time.measure(tmp_path, "cpu")
    assert min(speeds.checkpoint, speeds.pack) > 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("device", "room", "seeds_at_once", "expected"),
    [
        ("cpu", 0, 2, [["dcc 1", "md-0.2 1"], ["dcc 2", "md-0.2 2"]]),
        ("cuda", 8, 2, [["dcc 1, md-0.2 1, dcc 2, md-0.2 2"]]),
        ("cuda", 8, 1, [["dcc 1, md-0.2 1"], ["dcc 2, md-0.2 2"]]),
        ("cuda", 4, 2, [["dcc 1, md-0.2 1"], ["dcc 2, md-0.2 2"]]),
    ],
)
def test_lowest_seeds_of_all_variants_come_first(
    store: Store,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    device: str,
    room: int,
    seeds_at_once: int,
    expected: list[list[str]],
) -> None:
    """Whatever is finished can be compared; a GPU takes as many at once as half of it holds."""
    asked = plan(load_definition(str(store.question)), "quick", catalogue())
    sizes = Sizes(parameters=0, work=0.0, kernel="torch-autograd", kept=0, working=0, memory=1)
    monkeypatch.setattr("torch.cuda.mem_get_info", lambda: (room, room))
    with graceful_stop() as control:
        made = limited_time.Campaign(
            asked=asked,
            out=tmp_path,
            device=device,
            workers=2,
            seeds_at_once=seeds_at_once,
            ends=0.0,
            control=control,
        )
        batches = made._batches(asked.runs, {run.run_id: sizes for run in asked.runs})
    names = [
        [", ".join(f"{run.variant} {run.spec.seed}" for run in cohort) for cohort in batch]
        for batch in batches
    ]
    assert names == expected


def test_what_was_not_evaluated_is_evaluated_first(
    store: Store, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run that was trained when time was up is evaluated and packed the next time."""
    shutil.copytree(store.results, tmp_path, dirs_exist_ok=True)
    for record in list_runs(tmp_path):
        (record.path / "episodes.jsonl").unlink()
    assert campaign.main(arguments(store.question, tmp_path)) == 0
    assert len(contents(tmp_path / "tiny-quick-01.zip")) == 4
    said = capsys.readouterr().out
    assert "training" not in said
    for one, other in zip(list_runs(tmp_path), list_runs(store.results), strict=True):
        assert one.episodes() == other.episodes()


def test_copy_of_a_checkout_is_enough(tmp_path: Path) -> None:
    """Without .git, install or PYTHONPATH it trains, and its records carry the commit we named."""
    for part in ("msgdrop_cli", "envs", "ablations", "benchmarks"):
        shutil.copytree(ROOT / part, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "tiny.toml").write_text(QUESTION)
    given = ["benchmarks/campaign.py", *arguments(Path("tiny.toml"), Path("out"), "--seeds", "1")]

    def bare(**environment: str) -> subprocess.CompletedProcess[str]:
        left = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "MSGDROP_COMMIT")}
        return subprocess.run(
            [sys.executable, "-I", *given],
            cwd=tmp_path,
            env={**left, **environment},
            capture_output=True,
            text=True,
            timeout=60,
        )

    unnamed = bare()
    assert unnamed.returncode == 2
    assert "MSGDROP_COMMIT=" in unnamed.stderr
    assert not (tmp_path / "out").exists()
    commit = "0123456789" * 4
    done = bare(MSGDROP_COMMIT=f"{commit}+")
    assert done.returncode == 0, done.stderr
    assert {each.run["commit"] for each in list_runs(tmp_path / "out")} == {f"{commit}+"}


def test_detached_campaign_is_started_in_its_own_session(
    store: Store,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The same command without --detach, away from our terminal; what it says goes into a log."""
    started: list[tuple[list[str], dict[str, object]]] = []

    class Process:
        pid = 7

        def __init__(self, command: list[str], **how: object) -> None:
            started.append((command, how))

    with monkeypatch.context() as patch:
        patch.setattr(campaign, "commit", lambda: "0123456789" * 4)  # it asks git
        patch.setattr(subprocess, "Popen", Process)
        given = arguments(store.question, tmp_path)
        assert campaign.main([*given, "--detach"]) == 0
    [(command, how)] = started
    assert command[2:] == given
    assert how["start_new_session"]
    assert (tmp_path / "campaign.log").exists()
    assert "process 7 is at work" in capsys.readouterr().out


def test_status_is_shown(store: Store, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Anybody can ask how far a campaign has come."""
    campaign.main(arguments(store.question, tmp_path, "--seeds", "1"))
    capsys.readouterr()
    assert campaign.main(["--status", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "not at work (ended" in said
    assert "2 runs: 2 done; 2 packed" in said


@pytest.mark.parametrize(
    "content",
    ["{", "[]", "{}", '{"phase": 1, "written": 2, "runs": [3]}', '{"phase": 1, "written": 2}'],
)
def test_damaged_state_is_one_line(
    content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It names the file and what to do, and shows no traceback."""
    (tmp_path / "campaign.json").write_text(content)
    assert campaign.main(["--status", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert f"{tmp_path / 'campaign.json'}: is damaged" in said.err


def test_busy_folder_is_refused(
    store: Store, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two campaigns do not share a folder."""
    with run_lock(tmp_path):
        assert campaign.main(arguments(store.question, tmp_path)) == 75
    assert "is in use by another process" in capsys.readouterr().err
