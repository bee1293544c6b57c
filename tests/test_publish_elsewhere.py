"""A study stands on runs that another one has published: they are named, and found again."""

import json
import shutil
from pathlib import Path

import pytest

import msgdrop_cli
from msgdrop_cli.commands.parts.answers import readable_runs
from msgdrop_cli.records.elsewhere import ELSEWHERE, read_elsewhere
from msgdrop_cli.records.store import list_runs
from msgdrop_cli.records.sums import list_sums
from msgdrop_cli.report import mirrors
from tests.cli_runs import QUESTION, Said, filled_store, msgdrop
from tests.test_mirror import Fake

THIRD = """
[variants.fdc]
label = "FDC"
algorithm = { name = "fdc" }
[[claims]]
says = "Messages help"
source = "l. 2"
better = "dcc"
worse = "fdc"
environment = "pursuit-n6"
metric = "catches_per_500"
"""


def publish(folder: Path, question: str, *options: str | Path) -> Said:
    """Publish a question's runs of the results folder."""
    where = ("--results", folder / "results", "--to", folder / "results" / "published")
    return msgdrop("publish", folder / f"{question}.toml", *where, *options)


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clone with a study of two arms, whose owner has trained a third one for another question.

    `other` calls MD 0.2 by another name; its runs are the published ones.
    """
    folder = tmp_path_factory.mktemp("elsewhere")
    filled_store(folder)
    assert publish(folder, "tiny").code == 0
    shutil.rmtree(folder / "results" / "runs")
    renamed = QUESTION.replace('"md-0.2"', '"mine"').replace('"DCC-MD 0.2"', '"ours"')
    (folder / "other.toml").write_text(renamed + THIRD)
    where = ("--results", folder / "results", "--workers", "1")
    said = msgdrop("ablate", folder / "other.toml", *where)
    assert said.code == 0, said.err
    said = publish(folder, "other")
    assert said.code == 0, said.err
    return folder


@pytest.fixture
def clone(trained: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    return Path(shutil.copytree(trained, tmp_path / "clone"))


def studies(folder: Path) -> tuple[Path, Path]:
    """The study that has the runs, and the one that stands on them."""
    published = folder / "results" / "published"
    return published / "tiny-quick", published / "other-quick"


def test_a_study_has_all_of_its_arms(trained: Path) -> None:
    """Two runs lie in it and four beside it; page and claims are of six, and say so."""
    has, stands = studies(trained)
    assert sorted({run.variant for run in list_runs(stands)}) == ["fdc"]
    named = read_elsewhere(stands)
    assert sorted((run.variant, run.seed) for run in named) == [
        ("dcc", 1), ("dcc", 2), ("mine", 1), ("mine", 2),
    ]  # fmt: skip
    assert {run.label for run in named if run.variant == "mine"} == {"ours"}
    assert {run.definition for run in named} == {"other"}
    assert all(has.resolve() in run.path.parents for run in named)
    page = (stands / "TABLES.md").read_text()
    assert "4 of the 6 runs are published with a study beside this one" in page
    assert "| ours | pursuit-n6 | 2 | tiny-quick |" in page
    assert "not run" not in page
    assert ELSEWHERE in (stands / "SHA256SUMS").read_text()


def test_it_is_verified_with_them(trained: Path) -> None:
    """All studies, or that one alone."""
    _, stands = studies(trained)
    for place in (stands.parent, stands):
        said = msgdrop("verify", place)
        assert (said.code, said.err) == (0, ""), said.out
        assert "made again from 6 runs, 4 in other studies" in said.out


def test_who_asks_for_the_study_gets_all_of_it(trained: Path) -> None:
    """As its owner does: runs and page are of the same arms."""
    _, stands = studies(trained)
    said = msgdrop("status", stands, "--json")
    assert said.code == 0, said.err
    runs = json.loads(said.out)
    assert {*msgdrop_cli.results(stands)["run_id"]} == {run["run_id"] for run in runs}
    assert len(readable_runs(stands)[0]) == len(runs) == 6
    assert sorted({(run["variant"], run["definition"]) for run in runs}) == [
        ("dcc", "other"), ("fdc", "other"), ("mine", "other"),
    ]  # fmt: skip


@pytest.mark.parametrize("inside", [".", "published"])
def test_who_asks_for_all_studies_gets_each_whole(trained: Path, inside: str) -> None:
    """By the names of each, as with copies; in a table each run is a row of each, once."""
    root = trained / "results" / inside
    listed = json.loads(msgdrop("status", root, "--json").out)
    table = msgdrop_cli.results(root)
    named = [("other", "dcc"), ("other", "fdc"), ("other", "mine")]
    assert {(run["definition"], run["variant"]) for run in listed} >= {*named}
    assert {*zip(table["question"], table["variant"], strict=True)} == {
        ("tiny", "dcc"), ("tiny", "md-0.2"), *named,
    }  # fmt: skip
    assert len({run["run_id"] for run in listed}) == 6
    assert len(readable_runs(root)[0]) == len(listed)


def test_own_runs_that_were_published_are_named(clone: Path) -> None:
    """Their owner has them in hand still, and they need not lie there twice."""
    has, stands = studies(clone)
    shutil.rmtree(stands)
    for run in list_runs(has):
        own = clone / "results" / "runs" / "pursuit-n6" / run.path.name
        shutil.copytree(run.path, own)
    assert publish(clone, "other").code == 0
    assert {run.variant for run in list_runs(stands)} == {"fdc"}
    changed = next((clone / "results" / "runs").rglob("dcc-s1-*")) / "episodes.jsonl.gz"
    other = next(has.rglob("dcc-s2-*")) / "episodes.jsonl.gz"
    shutil.rmtree(stands)
    changed.write_bytes(other.read_bytes())
    assert publish(clone, "other").code == 0
    assert {(run.variant, run.seed) for run in list_runs(stands)} == {
        ("dcc", 1), ("fdc", 1), ("fdc", 2),
    }  # fmt: skip


def test_a_study_without_runs_of_its_own_has_those_that_it_names(
    clone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For everybody who asks, drawn as it was published."""
    question = (clone / "tiny.toml").read_text()
    (clone / "named.toml").write_text(question)
    shutil.rmtree(clone / "results" / "runs")
    assert publish(clone, "named").code == 0
    study = clone / "results" / "published" / "named-quick"
    assert not list(study.rglob("run.json"))
    assert len(json.loads(msgdrop("status", study, "--json").out)) == 4
    assert len(msgdrop_cli.results(study)["run_id"]) == 4
    assert msgdrop("diff", study, study.parent / "tiny-quick").code == 0
    monkeypatch.setitem(mirrors.MIRRORS, "tensorboard", Fake)
    assert "new row" in msgdrop("mirror", study, "--into", clone / "mirror").out
    for figure in map(Path, json.loads(msgdrop("plot", study, "--json").out)):
        published = study / "figures" / figure.name
        assert figure.suffix in {".pdf", ".svg"} or figure.read_bytes() == published.read_bytes()


def test_what_is_played_anew_has_the_names_of_the_study(trained: Path) -> None:
    """Also of runs that lie in another one, which calls them otherwise."""
    _, stands = studies(trained)
    said = msgdrop("eval", stands, "--channel", "none", "--episodes", "9", "--json")
    assert said.code == 0, said.err
    assert {row["variant"] for row in json.loads(said.out)["results"]} == {"dcc", "fdc", "mine"}


def test_published_again_it_is_the_same(clone: Path) -> None:
    """With its own runs or without them, and of one seed: nothing that it stands on is lost."""
    _, stands = studies(clone)
    before = {path: path.read_bytes() for path in stands.rglob("*") if path.is_file()}
    assert publish(clone, "other", "--seed", "2").code == 0
    shutil.rmtree(clone / "results" / "runs")
    assert publish(clone, "other", "--seed", "1").code == 0
    assert {path: path.read_bytes() for path in stands.rglob("*") if path.is_file()} == before


def test_a_run_that_is_gone_or_changed_there_is_found(clone: Path) -> None:
    """Where it is named, too, and alone."""
    has, stands = studies(clone)
    run = read_elsewhere(stands)[0].path
    log = run / "episodes.jsonl.gz"
    log.write_bytes((next(stands.rglob(log.name))).read_bytes())
    list_sums(has)  # whoever changed it knows of the list
    said = msgdrop("verify", stands)
    assert said.code == 65
    shutil.rmtree(run)
    said = msgdrop("verify", stands)
    assert said.code == 65
    assert "is not in " in said.out
    assert "put it back, or remove this file" in said.out


def test_what_diverged_here_is_not_made_good_by_what_is_published(clone: Path) -> None:
    """An own run that has ended counts: the study has nothing in its place."""
    has, stands = studies(clone)
    shutil.rmtree(stands)
    published = next(has.rglob("dcc-s1-*"))
    own = clone / "results" / "runs" / "pursuit-n6" / published.name
    failed = Path(shutil.copytree(published, own))
    record = json.loads((failed / "run.json").read_text()) | {"status": "diverged"}
    (failed / "run.json").write_text(json.dumps(record))
    assert publish(clone, "other").code == 0
    assert ("dcc", 1) not in {(run.variant, run.seed) for run in read_elsewhere(stands)}
    assert ("dcc", 1) not in {(run.variant, run.seed) for run in list_runs(stands)}


def test_a_list_that_leads_nowhere_stops_nobody_else(clone: Path) -> None:
    """The study itself is told to be damaged; of the folder the others are shown, with a note."""
    has, stands = studies(clone)
    shutil.rmtree(has)
    assert msgdrop("status", stands).code == 2
    said = msgdrop("status", clone / "results" / "published", "--json")
    assert said.code == 0
    assert {run["variant"] for run in json.loads(said.out)} == {"fdc"}
    assert "what other-quick names: " in said.err


def test_what_diverged_here_and_is_published_is_told(clone: Path) -> None:
    """One of the two is wrong, and which one is for somebody to find out."""
    has, _ = studies(clone)
    published = next(has.rglob("dcc-s1-*"))
    own = clone / "results" / "runs" / "pursuit-n6" / published.name
    shutil.copytree(published, own)
    record = json.loads((own / "run.json").read_text()) | {"status": "diverged"}
    (own / "run.json").write_text(json.dumps(record))
    for question in ("tiny", "other"):  # that has it, and that names it
        said = publish(clone, question)
        assert said.code == 2
        assert "diverged, and " in said.err
        assert "it is published as done: remove the copy that is wrong" in said.err


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("folder", "../runs/pursuit-n6/dcc-s1-01234567", "expected study/game/run"),
        ("folder", "/etc/x/y", "expected study/game/run"),
        ("folder", "tiny-quick/dcc-s1-01234567", "expected study/game/run"),
        ("profile", "../up", "profile is not a name"),
    ],
)
def test_a_list_leads_nowhere_else(clone: Path, key: str, value: str, problem: str) -> None:
    """Only to runs of the studies beside it."""
    _, stands = studies(clone)
    entries = json.loads((stands / ELSEWHERE).read_text())
    (stands / ELSEWHERE).write_text(json.dumps([{**entries[0], key: value}]))
    list_sums(stands)
    said = msgdrop("verify", stands)
    assert said.code == 65
    assert problem in said.out


@pytest.mark.parametrize("way", ["another name", "a link", "a link inside"])
def test_what_cannot_be_named_is_copied_or_passed_over(clone: Path, way: str) -> None:
    """A study that somebody has called otherwise; none is found through links."""
    has, stands = studies(clone)
    shutil.rmtree(stands)
    if way == "another name":
        has.rename(has.with_name("Of last year"))
    else:
        place = has if way == "a link" else has / "pursuit-n6"
        place.rename(clone / "moved")
        place.symlink_to(clone / "moved")
    assert publish(clone, "other").code == 0
    copied = 6 if way == "another name" else 2
    assert len(list_runs(stands)) == copied
    assert not (stands / ELSEWHERE).exists()


def test_where_no_study_lies_beside_it_published_runs_are_copied(
    trained: Path, tmp_path: Path
) -> None:
    """To another folder: the study is whole there, too."""
    where = ("--results", trained / "results", "--to", tmp_path)
    assert msgdrop("publish", trained / "other.toml", *where).code == 0
    study = tmp_path / "other-quick"
    assert len(list_runs(study)) == 6
    assert not (study / ELSEWHERE).exists()
    assert msgdrop("verify", study).code == 0
