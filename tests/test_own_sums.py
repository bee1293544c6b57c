"""`run.sha256`: no byte of a finished run of one's own changes unseen, and no crash is an alarm."""

import os
import random
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records import own_sums
from msgdrop_cli.records.archive import install, unpack, write_archive
from msgdrop_cli.records.files import read_bytes, write_bytes_atomic
from msgdrop_cli.records.own_sums import RUN_SUMS, run_differences, write_listed
from msgdrop_cli.records.store import EPISODES, RUN, list_runs, set_status
from msgdrop_cli.records.sums import digest
from tests.cli_runs import Store, copied_store, filled_store, msgdrop


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs, trained and evaluated once; tests that change them copy it."""
    return filled_store(tmp_path_factory.mktemp("own-sums"))


@pytest.fixture
def results(store: Store, tmp_path: Path) -> Path:
    """A copy of their folder, to be changed."""
    return copied_store(store, tmp_path).results


@pytest.fixture
def run(results: Path) -> Path:
    """The folder of one of them."""
    return min(results.rglob(RUN)).parent


def test_every_changed_byte_of_an_own_run_is_found(results: Path) -> None:
    """In its record, logs and policy, and in the list. With VERIFY_TRIALS=1000 that many."""
    trials = int(os.environ.get("VERIFY_TRIALS", "20"))
    chance = random.Random(trials)
    files = sorted(path for path in results.rglob("*-s*/*.*"))
    assert len(files) == 4 * 5
    for trial in range(trials):
        path = files[trial % len(files)]
        content = path.read_bytes()
        changed = bytearray(content)
        changed[chance.randrange(len(content))] ^= chance.randrange(1, 256)
        path.write_bytes(changed)
        said = msgdrop("verify", results)
        assert (said.code, path.parent.name in said.err) == (65, True), (path, said)
        path.write_bytes(content)
    assert msgdrop("verify", results).code == 0


def test_coreutils_read_the_list(run: Path) -> None:
    """Nobody needs msgdrop for it."""
    check = ["sha256sum", "--check", "--strict", "--quiet", RUN_SUMS]
    assert subprocess.run(check, cwd=run, timeout=60).returncode == 0


def test_the_list_goes_along_with_another_evaluation(results: Path, run: Path) -> None:
    """What is played later is listed, and nothing else is taken as it lies there by then."""
    before = (run / RUN_SUMS).read_text().splitlines()
    assert msgdrop("eval", results, "--episodes", "9", "--workers", "1").code == 0
    after = (run / RUN_SUMS).read_text().splitlines()
    assert {line.split()[1] for line in {*before} ^ {*after}} == {EPISODES}
    assert msgdrop("verify", results).code == 0


def test_an_evaluation_does_not_excuse_what_changed_before_it(results: Path, run: Path) -> None:
    """The digests of the other files stay those of the end of the training."""
    log = run / "metrics.jsonl"
    log.write_text(log.read_text().replace("1", "2", 1))
    assert msgdrop("eval", results, "--episodes", "9", "--workers", "1").code == 0
    assert f"{log}: SHA-256: expected" in msgdrop("verify", results).err


@pytest.mark.parametrize("write", [0, 1, 2])
def test_a_crash_at_any_write_leaves_a_run_that_its_list_knows(
    run: Path, write: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While a file is replaced both contents are listed; the next write forgets the older one."""
    content = (run / EPISODES).read_bytes() * 2
    done: list[Path] = []

    def crashing(path: Path, content: bytes) -> None:
        if len(done) == write:
            raise RecordError("crash", 74)
        done.append(path)
        write_bytes_atomic(path, content)

    with monkeypatch.context() as patch:
        patch.setattr(own_sums, "write_bytes_atomic", crashing)
        with pytest.raises(RecordError, match="crash"):
            write_listed(run / EPISODES, content)
    assert run_differences(run) == []
    write_listed(run / EPISODES, content)
    assert run_differences(run) == []
    assert len((run / RUN_SUMS).read_text().splitlines()) == 4


@pytest.mark.parametrize("look", [1, 2, 3, 4, 5])
def test_a_look_beside_an_evaluation_is_no_alarm(
    run: Path, look: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever file is being read when another process replaces the episodes."""
    content, looks = (run / EPISODES).read_bytes() * 2, list[Path]()

    def noted(reading: Callable[[Path], Any], path: Path) -> Any:
        looks.append(path)
        if len(looks) == look:
            write_listed(run / EPISODES, content)
        return reading(path)

    monkeypatch.setattr(f"{own_sums.__name__}.read_bytes", partial(noted, read_bytes))
    monkeypatch.setattr(f"{own_sums.__name__}.digest", partial(noted, digest))
    assert run_differences(run) == []
    assert len(looks) >= 5


def test_runs_of_an_earlier_version_have_no_list_and_are_no_damage(
    results: Path, run: Path
) -> None:
    """That is said; another evaluation does not vouch for what lies there."""
    (run / RUN_SUMS).unlink()
    assert msgdrop("eval", results, "--episodes", "9", "--workers", "1").code == 0
    said = msgdrop("verify", results)
    assert said.code == 0
    assert "not compared: digests of 1 finished run (no run.sha256: an earlier" in said.out


def test_a_run_that_is_no_longer_done_has_no_list(run: Path) -> None:
    """What is trained on changes with every row."""
    set_status(run, "interrupted")
    assert not (run / RUN_SUMS).exists()
    set_status(run, "done")
    assert run_differences(run) == []


def test_carried_runs_are_listed(run: Path, tmp_path: Path) -> None:
    """From where they are believed: the archive's own digests were checked before."""
    write_archive(tmp_path / "a.zip", list_runs(run))
    [record] = unpack(tmp_path / "a.zip", tmp_path / "unpacked")
    install(record, target := tmp_path / "here" / run.name)
    assert (target / RUN_SUMS).read_bytes() == (run / RUN_SUMS).read_bytes()


def test_published_runs_have_no_list_of_their_own(
    store: Store, results: Path, tmp_path: Path
) -> None:
    """Their folder has one of all its files."""
    to = tmp_path / "published"
    said = msgdrop("publish", store.question, "--results", results, "--to", to)
    assert said.code == 0, said.err
    assert [*to.rglob(RUN_SUMS)] == []
