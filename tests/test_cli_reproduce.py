"""`msgdrop reproduce`: from records to the page, as people type it."""

import gzip
import json
import shlex
import shutil
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from msgdrop_cli.definition.figures import all_figures
from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.plan import Plan, plan
from msgdrop_cli.definition.seeds import parse_seeds
from msgdrop_cli.engine.offers import catalogue
from tests.answering_runs import write_answers
from tests.cli_runs import ROOT, Said, msgdrop

CATALOGUE = catalogue()
STUDIES = ("navigation-half-million", "waterworld-half-million")
FILES = ["reproduce.html", "reproduce.json", "reproduce.md"]


class Made(NamedTuple):
    """A page, and what was said of it."""

    folder: Path
    said: Said
    document: dict[str, Any]

    @property
    def lines(self) -> list[dict[str, Any]]:
        """Every claim."""
        return [line for section in self.document["sections"] for line in section["lines"]]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Two published studies, some own runs that failed, and a run of nobody's claim."""
    folder = tmp_path_factory.mktemp("clone") / "results"
    for study in STUDIES:
        shutil.copytree(ROOT / "results" / "published" / study, folder / "published" / study)
    write_answers(folder, status="failed", reason="<b>out of memory</b>")
    said = msgdrop("reproduce", folder)
    return Made(folder, said, json.loads((folder / "reproduce.json").read_text()))


def test_three_files_are_written_and_named(made: Made) -> None:
    """With the counts of all six words; nothing else changes."""
    assert made.said.code == 0, made.said.err
    assert sorted(path.name for path in made.folder.glob("*.*")) == FILES
    assert all(str(made.folder / name) in made.said.out for name in FILES)
    for word, count in made.document["counts"].items():
        if word == "estimate":  # every shipped question is registered
            assert word not in made.said.out
            continue
        assert f"{word} {count}" in " ".join(made.said.out.split())


def test_no_claim_is_left_out(made: Made) -> None:
    """Of any shipped question, run or not; the counts are the paper's."""
    claims = Counter(name for name in list_definitions() for _ in load_definition(name).claims)
    assert Counter(line["question"] for line in made.lines) == claims
    words = Counter(line["word"] for line in made.lines if line["papers"])
    assert {word: count for word, count in made.document["counts"].items() if count} == words


def test_what_is_published_is_told(made: Made) -> None:
    """Two seeds of navigation and waterworld: estimates, each with what would decide it."""
    told = [line for line in made.lines if line["readings"] and line["readings"][0]["seeds"]]
    assert {line["environment"] for line in told if line["word"] == "undecided"} == {
        "navigation-n8",
        "waterworld-n8",
    }
    for line in told:
        assert line["decides"]["unforeseen"] == "below 3 seeds there is no forecast"
        assert line["decides"]["seeds"] == 10  # at 6 no p is small enough
        arms = {"navigation-n8": 4, "waterworld-n8": 5}[line["environment"]]
        assert line["decides"]["runs"] == 10 * arms - 6, (
            "all arms of its family, less what is there"
        )
        assert line["decides"]["seconds"] > 0.0


def test_what_nobody_has_run_says_so_where_it_says_what_would_decide(made: Made) -> None:
    """As a claim of two seeds does: the seeds of the next look are no forecast."""
    open_ones = [line for line in made.lines if line["word"] == "not run" and line["decides"]]
    assert len(open_ones) > 50
    assert {line["decides"]["unforeseen"] for line in open_ones} == {
        "below 3 seeds there is no forecast"
    }


def test_what_is_not_run_is_asked_at_the_scale_of_what_is(made: Made) -> None:
    """In each of a game's rows; the figure's runs are those of what is said beside it."""
    lines = [line for line in made.lines if line["question"] == "waterworld"]
    assert {line["measure"] for line in lines} == {"learning", "evaluation"}
    assert all("--profile half-million " in line["command"] for line in lines)
    asked = [line["command"].split()[2] for line in lines if line["word"] == "not run"]
    assert {*asked} == {"figure-3e", "figure-3f"}


def test_published_files_that_were_changed_are_told(tmp_path: Path, made: Made) -> None:
    """On stderr and on the page, with what to type; the exit code is that of the numbers."""
    assert "SHA256SUMS" not in made.said.err
    assert made.document["altered"] == []
    study = tmp_path / "results" / "published" / STUDIES[0]
    shutil.copytree(ROOT / "results" / "published" / STUDIES[0], study)
    changed = next(study.rglob("metrics.jsonl.gz"))
    changed.write_bytes(gzip.compress(gzip.decompress(changed.read_bytes()), mtime=1))
    said = msgdrop("reproduce", tmp_path / "results")
    sentence = f"1 file in {study} differs from its SHA256SUMS: msgdrop verify {study}"
    assert (said.code, " ".join(said.err.split()).count(sentence)) == (0, 1)
    for kind in ("html", "md", "json"):
        assert sentence in (tmp_path / "results" / f"reproduce.{kind}").read_text()


def test_failed_runs_are_named_with_their_reason(made: Made) -> None:
    """Escaped, too."""
    failed = [each for each in made.document["dropped"] if each["what"] == "failed"]
    assert len(failed) == 8
    assert {each["reason"] for each in failed} == {"<b>out of memory</b>"}
    page = (made.folder / "reproduce.html").read_text()
    assert "&lt;b&gt;out of memory&lt;/b&gt;" in page
    assert "<b>out of memory" not in page


def test_figures_stand_with_the_claims_that_they_show(made: Made) -> None:
    """Learning curves, and their differences, with what is said of learning."""
    page = (made.folder / "reproduce.html").read_text()
    section = page.partition('id="figure-3c"')[2].partition("<section")[0]
    assert section.count("data:image/png;base64,") == 2
    assert "navigation-n8-half-million-500000-learning-differences" in section


@cache
def asked(command: str) -> Plan:
    """What a row's command plans."""
    program, ablate, name, *options = shlex.split(command)
    assert (program, ablate) == ("msgdrop", "ablate")
    said = dict(zip(options[::2], options[1::2], strict=True))
    readings = [said["--reading"]] if "--reading" in said else []
    seeds = parse_seeds(said["--seeds"])
    return plan(load_definition(name), said["--profile"], CATALOGUE, readings=readings, seeds=seeds)


def test_every_rows_command_makes_the_row(made: Made) -> None:
    """It plans both arms in the row's game and the evaluation, and has the runs that are there.

    It judges the claim, too, unless nobody has run it and the question leaves an arm out there.
    """
    for line in made.lines:
        found = asked(line["command"])
        arms = {(run.spec.environment, run.variant) for run in found.runs}
        assert arms.issuperset((line["environment"], line[arm]) for arm in ("better", "worse"))
        assert line["channel"] in {"", *(channel.short for channel in found.channels)}
        ordering = (line["better"], line["worse"], line["environment"], line["measure"])
        claims = [(c.better, c.worse, c.environment, c.measure) for c in found.claims]
        assert ordering in claims or line["word"] == "not run", line["command"]
        for reading in line["readings"]:
            again = {run.run_id for run in asked(reading["command"]).runs}
            assert again.issuperset(reading["runs"])


def test_a_figures_rows_ask_for_no_other_game(made: Made) -> None:
    """Whose question has more of them, at a scale that leaves none out."""
    sections = {each["key"]: each["lines"] for each in made.document["sections"]}
    for name, figure in all_figures().items():
        for line in sections.get(name, ()):
            games = {run.spec.environment for run in asked(line["command"]).runs}
            assert games <= {*figure.environments}, line["command"]


def test_json_is_the_document(made: Made, tmp_path: Path) -> None:
    """On stdout what stands in the file; what is published is never written to."""
    folder = tmp_path / "results"
    study = folder / "published" / STUDIES[0]
    shutil.copytree(made.folder / "published" / STUDIES[0], study)
    before = sorted(study.rglob("*"))
    said = msgdrop("reproduce", folder / "published", "--json")
    assert said.code == 0, said.err
    assert json.loads(said.out) == json.loads((folder / "reproduce.json").read_text())
    assert sorted(path.name for path in folder.glob("*.*")) == FILES
    assert sorted(study.rglob("*")) == before


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    """Nothing is made for it."""
    said = msgdrop("reproduce", tmp_path / "nowhere")
    assert said.code == 2
    assert "nowhere" in said.err
    assert not (tmp_path / "nowhere").exists()


def test_damage_is_told_and_costs_only_its_run(tmp_path: Path) -> None:
    """A line on stderr and the code of damaged records; the page is of the others."""
    study = tmp_path / "results" / "published" / "navigation-half-million"
    shutil.copytree(ROOT / "results" / "published" / study.name, study)
    damaged = min(study.rglob("run.json"))
    damaged.write_text("{")
    said = msgdrop("reproduce", tmp_path / "results")
    assert said.code == 2
    assert f"{damaged}: is damaged" in said.err
    assert (tmp_path / "results" / "reproduce.html").exists()


def test_a_folder_without_runs_is_no_place_for_a_page(tmp_path: Path) -> None:
    """As for every other command; nothing is written."""
    said = msgdrop("reproduce", tmp_path)
    assert said.code == 2
    assert "no finished run of a shipped question is there" in said.err
    assert list(tmp_path.iterdir()) == []
