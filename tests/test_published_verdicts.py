"""The published records under the registered rule: what README and results/README say of them."""

import re
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

from msgdrop_cli.analysis.claims import judge_claims
from msgdrop_cli.analysis.summary import Summary, summarise
from msgdrop_cli.analysis.verdict import Verdict
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.records.store import list_runs

PUBLISHED = Path(__file__).parents[1] / "results" / "published"
STUDIES = {
    "blockwise-vs-elementwise-two-million": "blockwise-vs-elementwise",
    "broken-links-two-million": "broken-links",
    "navigation-million-nearest": "navigation",
    "navigation-half-million": "navigation",
    "waterworld-half-million": "waterworld",
}


@cache
def study(folder: str) -> Summary:
    """Its arms, measured."""
    records = list_runs(PUBLISHED / folder)
    if folder.startswith("blockwise"):  # shares three of its variants with the other question
        others = list_runs(PUBLISHED / "broken-links-two-million")
        records += [record for record in others if record.variant != "md-0.5"]
    return summarise(records)


def verdicts(folder: str, measure: str) -> list[Verdict]:
    """Of the claims of one study and measure, on the game that was played."""
    definition = load_definition(STUDIES[folder])
    summary = study(folder)
    games = {group.environment for group in summary.groups}
    claims = [c for c in definition.claims if c.environment in games and c.measure == measure]
    return judge_claims(claims, summary, definition)


@pytest.mark.parametrize("folder", ["navigation-half-million", "waterworld-half-million"])
def test_nothing_is_decided_yet(folder: str) -> None:
    """Two seeds reach no p that the registration would take."""
    found = verdicts(folder, "evaluation") + verdicts(folder, "learning")
    assert {verdict.verdict for verdict in found} <= {"undecided", "not run"}
    assert all("registered look at" in each.reason for each in found if each.seeds)


def test_all_directions_of_the_broken_links_are_the_papers() -> None:
    """Eight of eight, and four of them are supported at the second look."""
    found = verdicts("broken-links-two-million", "evaluation")
    assert all(each.difference is not None and each.difference > 0.0 for each in found)
    supported = {(v.claim.better, v.claim.worse) for v in found if v.verdict == "supported"}
    assert Counter(verdict.verdict for verdict in found) == {"supported": 4, "undecided": 4}
    assert supported == {
        *(("md-0.2", "fdc"), ("md-0.5", "fdc")),  # half broken
        *(("md-0.2", "dcc"), ("md-0.5", "dcc")),  # all broken
    }
    evidence = [each.evidence for each in found if each.evidence]
    assert Counter(1024 * each.p for each in evidence) == {2: 5, 8: 1, 10: 1, 36: 1}
    assert {each.smallest_p for each in evidence} == {2 / 1024}


def test_whole_messages_beat_elements_after_training_only() -> None:
    """Of the claims of figure 5 a's question one is supported at the second look."""
    [after] = verdicts("blockwise-vs-elementwise-two-million", "evaluation")
    learning = verdicts("blockwise-vs-elementwise-two-million", "learning")
    assert (after.claim.better, after.claim.worse, after.verdict) == (
        "md-0.2",
        "sd-0.2",
        "supported",
    )
    assert [each.verdict for each in learning] == ["undecided"] * 3


def test_navigation_in_training_and_after() -> None:
    """In training seven of eight comparisons are the paper's and one is not; after it none is."""
    learning = verdicts("navigation-million-nearest", "learning")
    assert Counter(each.verdict for each in learning) == {"supported": 7, "contradicted": 1}
    [other] = [each.claim for each in learning if each.verdict == "contradicted"]
    assert (other.environment, other.better, other.worse) == ("navigation-n10", "md-0.5", "dcc")
    after = verdicts("navigation-million-nearest", "evaluation")
    assert [each.verdict for each in after] == ["undecided"] * 8


def test_published_runs_are_from_before_there_was_a_registration() -> None:
    """They read as before, and the verdict says so."""
    records = list_runs(PUBLISHED)
    assert {record.registration for record in records} == {None}
    for verdict in verdicts("broken-links-two-million", "evaluation"):
        assert "20 of the runs are from before broken-links:" in verdict.reason


def test_the_table_of_what_was_judged_again_is_what_comes_out() -> None:
    """Every row of results/README: the difference with its interval, p alone, together, by Holm."""
    table = (PUBLISHED.parent / "README.md").read_text().partition("## Judged again")[2]
    rows = [line.split(" | ") for line in table.partition("\n## ")[0].splitlines()]
    typed = [row[1:5] for row in rows if row[0].startswith("| ") and row[-1] != "was |"]
    found = [
        [each.difference, *(each.interval or ()), each.evidence]
        for folder, measure in (
            ("broken-links-two-million", "evaluation"),
            ("blockwise-vs-elementwise-two-million", "evaluation"),
            ("blockwise-vs-elementwise-two-million", "learning"),
            ("navigation-million-nearest", "learning"),
            ("navigation-million-nearest", "evaluation"),
        )
        for each in verdicts(folder, measure)
    ]
    assert len(typed) == len(found) == 28
    for (difference, *ps), (mean, low, high, evidence) in zip(typed, found, strict=True):
        numbers = [float(number) for number in re.findall(r"-?[\d.]+", difference)]
        assert numbers == pytest.approx([mean, low, high], abs=0.0501)
        assert ps == [f"{p:.2g}" for p in (evidence.p, evidence.p_family, evidence.p_holm)]
