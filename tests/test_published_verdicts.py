"""The published records under the registered rule: right values, which no page gives to itself."""

from collections import Counter

import pytest

from benchmarks.readme.studies import EIGHT, PUBLISHED, SIX, study
from msgdrop_cli.analysis.verdict import Verdict
from msgdrop_cli.records.store import list_runs


def verdicts(folder: str, measure: str, environment: str | None = None) -> list[Verdict]:
    """Of the claims of one study and measure, in one of its games or in all."""
    found = study(folder, environment).verdicts
    return [each for each in found if each.claim.measure == measure]


@pytest.mark.parametrize(
    "folder",
    [
        "navigation-half-million",
        "waterworld-half-million",
        "waterworld-half-million-stopping-walls",
    ],
)
def test_nothing_is_decided_yet(folder: str) -> None:
    """Two seeds reach no p that the registration would take."""
    found = verdicts(folder, "evaluation") + verdicts(folder, "learning")
    assert {verdict.verdict for verdict in found} <= {"undecided", "not run"}
    assert all("registered look at" in each.reason for each in found if each.seeds)


def test_all_directions_of_the_broken_links_are_the_papers() -> None:
    """Eight of eight, and four of them are supported at the second look."""
    found = verdicts("broken-links-two-million", "evaluation", SIX)
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


def test_with_eight_agents_one_direction_is_open() -> None:
    """Seven of eight supported at the second look, whose alpha is whole: nothing had been seen."""
    found = verdicts("broken-links-two-million", "evaluation", EIGHT)
    [other] = [each for each in found if each.verdict != "supported"]
    assert (other.claim.better, other.claim.worse, other.verdict) == ("md-0.5", "dcc", "undecided")
    evidence = [each.evidence for each in found if each.evidence]
    assert Counter(1024 * each.p for each in evidence) == {2: 6, 12: 1, 48: 1}
    assert {(each.look, each.seeds, each.alpha_spent) for each in evidence} == {(2, 10, 0.025)}


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


def test_the_own_observation_should_be_kept() -> None:
    """Figure 5 a at ten seeds: whoever drops it learns slower; faster than DCC is nobody surely."""
    learning = verdicts("own-observation-two-million", "learning")
    found = {(v.claim.better, v.claim.worse): v.verdict for v in learning}
    assert {pair for pair, word in found.items() if word == "supported"} == {
        ("md-0.2", "full-md-0.2"),
        ("dcc", "full-md-0.2"),
        ("dcc", "full-sd-0.2"),
        ("sd-0.2", "full-sd-0.2"),
    }
    assert Counter(found.values()) == {"supported": 4, "undecided": 3}
    after = verdicts("own-observation-two-million", "evaluation")
    assert [each.verdict for each in after] == ["supported"] * 3
    assert sorted(1024 * each.evidence.p for each in after if each.evidence) == [2, 2, 6]


def test_the_network_that_keeps_the_own_apart_learns_better() -> None:
    """Figure 5 b with six agents; one seed of ten is the other way."""
    [found] = verdicts("architecture-two-million", "learning", SIX)
    assert (found.claim.worse, found.verdict) == ("concat-md-0.2", "supported")
    assert found.evidence is not None
    assert found.evidence.p == 4 / 1024


def test_navigation_in_training_and_after() -> None:
    """In training seven of eight comparisons are the paper's and one is not; after it none is."""
    learning = verdicts("navigation-million-nearest", "learning")
    assert Counter(each.verdict for each in learning) == {"supported": 7, "contradicted": 1}
    [other] = [each.claim for each in learning if each.verdict == "contradicted"]
    assert (other.environment, other.better, other.worse) == ("navigation-n10", "md-0.5", "dcc")
    after = verdicts("navigation-million-nearest", "evaluation")
    assert [each.verdict for each in after] == ["undecided"] * 8
    looks = Counter((v.claim.environment, v.evidence.seeds) for v in after if v.evidence)
    assert looks == {("navigation-n8", 14): 4, ("navigation-n10", 10): 4}
    in_training = {each.evidence.seeds for each in learning if each.evidence}
    assert in_training == {10}, "what the second look decided is not asked again"


def test_with_hubers_loss_neither_rate_beats_dcc() -> None:
    """Figure 3 d at the second look: both learn better than FDC and worse than simple DCC."""
    found = verdicts("figure-3d-million-nearest-huber", "learning")
    words = {(v.claim.better, v.claim.worse): v.verdict for v in found}
    assert words == {
        ("md-0.2", "dcc"): "contradicted",
        ("md-0.2", "fdc"): "supported",
        ("md-0.5", "dcc"): "contradicted",
        ("md-0.5", "fdc"): "supported",
    }
    assert {1024 * each.evidence.p for each in found if each.evidence} == {2}


def test_with_a_faster_target_network_a_fifth_is_level_with_dcc() -> None:
    """Figure 3 d at the second look: p of 0.5 against DCC is 12 of 1,024, and 10 may be spent."""
    found = verdicts("figure-3d-million-nearest-target-250", "learning")
    evidence = {(v.claim.better, v.claim.worse): (v.verdict, v.evidence) for v in found}
    assert {pair: (word, 1024 * e.p_family) for pair, (word, e) in evidence.items() if e} == {
        ("md-0.2", "dcc"): ("level", 700),
        ("md-0.2", "fdc"): ("supported", 2),
        ("md-0.5", "dcc"): ("undecided", 12),
        ("md-0.5", "fdc"): ("supported", 2),
    }


def test_waterworld_decides_that_concatenating_fails_and_no_order() -> None:
    """Figure 3 e at the second look: vanilla MADDPG is beaten; MADDPG-MD beats nobody surely."""
    for measure in ("learning", "evaluation"):
        found = [v for v in verdicts("waterworld-million", measure) if v.evidence]
        supported = {(v.claim.better, v.claim.worse) for v in found if v.verdict == "supported"}
        assert supported == {("maddpg", "vanilla-maddpg")}
        assert Counter(each.verdict for each in found) == {"supported": 1, "undecided": 4}
        assert {each.evidence.look for each in found if each.evidence} == {2}


def test_who_was_planned_under_a_registration() -> None:
    """The others are from before there was any; they read as before, and the verdict says so."""
    registered = Counter(record.registration for record in list_runs(PUBLISHED))
    assert {name: registered[name] for name in registered if name} == {
        "waterworld:add430c6": 62,
        "figure-3d:6aca268a": 80,
        "navigation:0a72786f": 16,
    }
    for verdict in verdicts("broken-links-two-million", "evaluation", SIX):
        assert "20 of the runs were planned before broken-links:" in verdict.reason
