"""`msgdrop verify`: no change goes unnoticed, and what is as it was published is never doubted."""

import gzip
import json
import os
import random
import shutil
import subprocess
from pathlib import Path

import pytest

from msgdrop_cli.records.own_sums import begin_list
from msgdrop_cli.records.sums import SUMS, differences, list_sums
from msgdrop_cli.signals import _looked_through
from tests.cli_runs import Store, copied_store, filled_store, msgdrop
from tests.faults.stores import CHANGES, changed_byte

PUBLISHED = Path(__file__).parents[1] / "results" / "published"
STUDIES = sorted(path for path in PUBLISHED.iterdir() if path.is_dir())
SMALL = "navigation-half-million"


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A copy of a published study, to be changed."""
    return Path(shutil.copytree(PUBLISHED / SMALL, tmp_path / "published" / SMALL))


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs of somebody's own question, trained once; tests that change them copy it."""
    return filled_store(tmp_path_factory.mktemp("verify"))


def contents(folder: Path) -> dict[Path, bytes]:
    """Every file below a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("name", [SMALL, "waterworld-half-million"])
def test_what_is_published_comes_out_again(name: str) -> None:
    """Digests, runs, page and figure of a study; nothing is written there."""
    before = contents(PUBLISHED / name)
    said = msgdrop("verify", PUBLISHED / name)
    assert (said.code, said.err) == (0, "")
    assert said.out.startswith(f"same     {PUBLISHED / name}  (")
    assert contents(PUBLISHED / name) == before


@pytest.mark.slow
def test_all_that_is_published_comes_out_again() -> None:
    """In the repository's own results folder, as a fresh clone has it."""
    said = msgdrop("verify", PUBLISHED)
    assert said.code == 0, said.out
    assert said.out.count("same  ") == len(STUDIES) >= 5


@pytest.mark.parametrize("folder", STUDIES, ids=lambda path: path.name)
def test_every_published_file_is_listed(folder: Path) -> None:
    """And is what it was when the list was written."""
    assert [*differences(folder)] == []


def test_coreutils_read_the_list(study: Path) -> None:
    """Nobody needs msgdrop for the digests."""
    check = ["sha256sum", "--check", "--strict", "--quiet", SUMS]
    assert subprocess.run(check, cwd=study, timeout=60).returncode == 0
    (study / "TABLES.md").write_text("other")
    assert subprocess.run(check, cwd=study, capture_output=True, timeout=60).returncode == 1


def test_every_change_is_found_and_its_file_named(study: Path) -> None:
    """Any byte of any file; half of the changes are of a single byte. Undone, all is well again.

    With VERIFY_TRIALS=1000 there are so many of them.
    """
    trials = int(os.environ.get("VERIFY_TRIALS", "60"))
    chance = random.Random(trials)
    before = contents(study)
    for trial in range(trials):
        change = changed_byte if trial % 2 else chance.choice(CHANGES)
        path = chance.choice(sorted(before))
        change(path, chance)
        said = msgdrop("verify", study.parent)
        assert said.code == 65, (change.__name__, path, said)
        assert f"{path}" in said.err or path.name == SUMS, (change.__name__, said.err)
        assert "expected" in said.err
        for each in {*contents(study), *(e for e in study.rglob("*") if e.is_symlink())} - {
            *before
        }:
            each.unlink()
        for each, content in before.items():
            each.unlink(missing_ok=True)
            each.write_bytes(content)
    assert msgdrop("verify", study.parent).code == 0


def test_a_number_that_its_episodes_do_not_give_is_named(study: Path) -> None:
    """Also where the list was written anew: file, line, what is expected and what was found."""
    page = study / "TABLES.md"
    page.write_text(
        page.read_text().replace("| -91.5 [-91.9, -91.0] |", "| -91.4 [-91.9, -91.0] |")
    )
    list_sums(study)
    said = msgdrop("verify", study)
    assert said.code == 65
    assert "1 difference; the first: " in said.err
    assert f"{page}: line 6: expected '| DCC | 2 | -91.5 [-91.9" in said.err
    assert "found '| DCC | 2 | -91.4 [-91.9" in said.err


def test_a_verdict_that_its_runs_do_not_give_is_named(study: Path) -> None:
    """A word of the claims' table is no less than a number."""
    page = study / "TABLES.md"
    page.write_text(page.read_text().replace("| undecided |", "| supported |", 1))
    list_sums(study)
    said = msgdrop("verify", study)
    assert said.code == 65
    assert "| undecided |" in said.err.partition("found")[0]
    assert "| supported |" in said.err.partition("found")[2]


def test_other_episodes_give_other_tables(study: Path) -> None:
    """Raw numbers that were changed before the list was written show in what is made of them."""
    log = next(study.rglob("fdc-s1-*/episodes.jsonl.gz"))
    rows = [json.loads(line) for line in gzip.decompress(log.read_bytes()).splitlines()]
    for row in rows:
        row["return"] += 1.0
    log.write_bytes(gzip.compress("".join(json.dumps(row) + "\n" for row in rows).encode()))
    list_sums(study)
    said = msgdrop("verify", study, "--json")
    assert said.code == 65
    [found] = json.loads(said.out)
    assert found["differences"][0]["file"] == str(study / "TABLES.md")


def test_another_curve_gives_another_claims_row(study: Path) -> None:
    """The differences over training are computed again from the windows of the logs."""
    log = next(study.rglob("dcc-s1-*/metrics.jsonl.gz"))
    rows = [json.loads(line) for line in gzip.decompress(log.read_bytes()).splitlines()]
    rows[3]["return_per_episode"] += 5.0
    log.write_bytes(gzip.compress("".join(json.dumps(row) + "\n" for row in rows).encode()))
    list_sums(study)
    said = msgdrop("verify", study)
    assert said.code == 65
    assert said.err.count("over training | ") == 2  # what is expected, and what was found


def test_a_record_under_another_id_is_found(study: Path) -> None:
    """The id is the hash of the settings, whatever the list says."""
    record = next(study.rglob("dcc-s1-*/run.json"))
    run = json.loads(record.read_text())
    run["spec"]["algorithm"]["gamma"] = 0.98
    record.write_text(json.dumps(run))
    list_sums(study)
    said = msgdrop("verify", study)
    assert said.code == 65
    assert "its run id is not the one of its settings" in said.err


def test_what_no_record_gives_is_found(study: Path) -> None:
    """A listed file must be a record, or be made of records."""
    (study / "figures" / "better.png").write_bytes(b"drawn elsewhere")
    list_sums(study)
    said = msgdrop("verify", study)
    assert said.code == 65
    assert f"{study / 'figures' / 'better.png'}: file: expected none" in said.err


def test_published_runs_that_no_list_names_are_found(study: Path) -> None:
    """Without list and page nobody could say what is missing."""
    (study / SUMS).unlink()
    assert f"{study / SUMS}: file: expected the list" in msgdrop("verify", study.parent).err
    (study / "TABLES.md").unlink()
    said = msgdrop("verify", study.parent)
    assert said.code == 65
    assert f"expected one in a folder with {SUMS}" in said.err


def test_a_part_of_a_study_is_no_study(study: Path) -> None:
    """The line names the whole; and nothing is found in an empty folder."""
    said = msgdrop("verify", study / "navigation-n8")
    assert said.code == 2
    assert f"is a part of {study}" in said.err
    (study / "empty").mkdir()
    assert msgdrop("verify", study.parent.parent / "none").code == 2


def test_a_list_of_somebodys_downloads_makes_no_study(study: Path) -> None:
    """A folder above may have a SHA256SUMS, too."""
    (study.parents[1] / SUMS).write_text(f"{'0' * 64}  debian.iso\n")
    assert msgdrop("verify", study.parent).code == 0


def test_folders_without_end_are_no_bug(study: Path) -> None:
    """Nobody's records lie deeper than thirty-two folders."""
    folders = [study.parent / "d"]
    while len(folders) < 1_100:
        folders.append(folders[-1] / "d")
    try:
        for each in folders:
            each.mkdir()
        codes = [msgdrop(command, study.parent).code for command in ("verify", "plot")]
    finally:
        for each in reversed(folders):  # pytest's own way is recursive, too
            each.rmdir()
    assert codes == [0, 0]


def test_what_a_killed_publish_left_is_not_listed(store: Store, tmp_path: Path) -> None:
    """A minute later nobody holds it; what cannot be listed is refused before anything changes."""
    to = tmp_path / "published"
    publish = ("publish", store.question, "--results", store.results, "--to", to)
    assert msgdrop(*publish).code == 0
    before = contents(to)
    left = to / "tiny-quick" / "pursuit-n6" / ".tmp-abcd1234"
    left.mkdir()
    (left / "run.json").write_text("{}")
    os.utime(left, (1.0, 1.0))
    _looked_through.clear()  # as a process of another day
    assert msgdrop(*publish).code == 0
    assert contents(to) == before
    (to / "tiny-quick" / os.fsdecode(b"caf\xe9.txt")).write_text("mine")
    page = to / "tiny-quick" / "TABLES.md"
    page.write_text("old")
    said = msgdrop(*publish)
    assert said.code == 2
    assert "is no file that can be listed; remove it" in said.err
    assert page.read_text() == "old"


def test_own_runs_are_checked_against_their_records(store: Store, tmp_path: Path) -> None:
    """In words before any digest: a torn log, a damaged policy, another run's place."""
    assert msgdrop("verify", store.results).code == 0
    copy = copied_store(store, tmp_path).results
    first, second, third, fourth = sorted(path.parent for path in copy.rglob("run.json"))
    with (first / "metrics.jsonl").open("a") as log:
        log.write('{"env_steps": 2')
    (second / "policy.safetensors").write_bytes((second / "policy.safetensors").read_bytes()[:-1])
    rows = (third / "episodes.jsonl").read_text().splitlines(keepends=True)
    (third / "episodes.jsonl").write_text("".join(rows[:2] + rows[3:]))
    fourth.rename(fourth.with_name("md-0.2-s7-01234567"))
    said = msgdrop("verify", copy, "--json")
    assert said.code == 65
    [found] = json.loads(said.out)
    for difference, words in zip(
        found["differences"],
        (
            "metrics.jsonl: its last line is torn",
            "policy.safetensors: is damaged",
            "episodes.jsonl: is empty, or an episode is missing or doubled",
            "run.json: it stands in another run's place",
        ),
        strict=True,
    ):
        assert words in difference["found"]


def test_a_run_that_is_not_evaluated_yet_is_no_damage(store: Store, tmp_path: Path) -> None:
    """Its training is done, and the command that goes on will play: no false alarm."""
    copy = copied_store(store, tmp_path).results
    episodes = next(copy.rglob("dcc-s1-*/episodes.jsonl"))
    episodes.unlink()
    begin_list(episodes.parent)  # as it is when a training has just ended
    said = msgdrop("verify", copy)
    assert said.code == 0, said.err
    assert "not compared: evaluation of dcc-s1-" in said.out


def test_a_folder_above_that_happens_to_be_called_published_is_none(
    store: Store, tmp_path: Path
) -> None:
    """Nor must runs that somebody put elsewhere be listed."""
    results = Path(shutil.copytree(store.results / "runs", tmp_path / "published" / "mine" / "a"))
    assert msgdrop("verify", results.parent).code == 0


def test_a_question_of_ones_own_travels_with_its_runs(store: Store, tmp_path: Path) -> None:
    """Its tables come out again wherever the folder goes; without its file this is said."""
    to = tmp_path / "published"
    said = msgdrop("publish", store.question, "--results", store.results, "--to", to)
    assert said.code == 0, said.err
    assert msgdrop("verify", to).code == 0
    (to / "tiny-quick" / "tiny.toml").unlink()
    list_sums(to / "tiny-quick")
    said = msgdrop("verify", to)
    assert said.code == 0, said.err
    assert "not compared: tables and figures (the question tiny is not known here" in said.out
    (to / "tiny-quick" / "tiny.toml").write_text(store.question.read_text().replace("quick", "q"))
    list_sums(to / "tiny-quick")
    said = msgdrop("verify", to)
    assert said.code == 65
    assert "no profile is called 'quick'" in said.err
