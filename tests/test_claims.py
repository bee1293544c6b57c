"""Claims against runs: every verdict can be reached, and only as it was registered."""

from dataclasses import replace
from pathlib import Path

import pytest

from msgdrop_cli.analysis.claims import judge_claims
from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.registration import registered_as
from msgdrop_cli.definition.spec import Registration
from tests.claims import AT_SIX, CLAIM, HIGH, LOW, arms, asking, verdict_on
from tests.fake_runs import write_arm, write_run


@pytest.mark.parametrize(
    ("better", "worse", "word"),
    [
        (HIGH, LOW, "supported"),
        (LOW, HIGH, "contradicted"),
        ([1, 18, 2, 17, 1, 18], [17, 2, 18, 1, 17, 2], "undecided"),
        (HIGH, HIGH, "level"),
    ],
)
def test_six_seeds_that_agree_decide(
    tmp_path: Path, better: list[int], worse: list[int], word: str
) -> None:
    """In either direction, where the registration lets six seeds decide: p is 2 / 64."""
    verdict = verdict_on(arms(tmp_path, better, worse))
    assert verdict.verdict == word
    assert verdict.difference == pytest.approx((sum(better) - sum(worse)) / 6)
    assert verdict.evidence is not None
    assert (verdict.evidence.p == 0.03125) == (word in ("supported", "contradicted"))
    assert "smallest possible 0.031" in verdict.reason


def test_the_shipped_questions_decide_nothing_at_six_seeds(tmp_path: Path) -> None:
    """They spend 0.015 there, and no six seeds can have a p below 0.031."""
    rule = load_definition("broken-links").registration
    verdict = verdict_on(arms(tmp_path, HIGH, LOW), rule=rule)
    assert verdict.verdict == "undecided"
    assert "that alpha is gone; next registered look at 10 seeds; 10 would probably" in (
        verdict.reason
    )


def test_what_was_seen_in_another_game_takes_nothing(tmp_path: Path) -> None:
    """Six seeds decide where they had not been looked at, and say under which name."""
    seen = replace(AT_SIX, seen=6)
    elsewhere = replace(seen, seen_in={"pursuit-n6": 0})
    records = arms(tmp_path, HIGH, LOW)
    here, there = (verdict_on(records, rule=rule) for rule in (seen, elsewhere))
    assert (here.verdict, there.verdict) == ("undecided", "supported")
    assert "that alpha is gone" in here.reason
    assert "gone" not in there.reason
    assert f"before {registered_as(asking(CLAIM), 'pursuit-n6')} was registered" in there.reason


def test_a_part_of_a_family_is_not_judged_alone(tmp_path: Path) -> None:
    """Else whoever asks for one claim of two has a smaller p: the family is the question's."""
    other = replace(CLAIM, worse="fdc")
    records = [*arms(tmp_path, HIGH, LOW), *write_arm(tmp_path, "fdc", LOW)]
    whole = asking(CLAIM, other)
    [alone] = judge_claims([CLAIM], summarise(records), whole)
    assert (alone.verdict, alone.evidence) == ("undecided", None)
    assert alone.reason.startswith("1 of the 2 claims of its family")
    assert judge_claims([CLAIM, other], summarise(records), whole)[0].verdict == "supported"


def test_a_claim_that_cannot_be_judged_holds_up_no_other(tmp_path: Path) -> None:
    """Both of its arms broke down: no more seeds would ever make that family whole."""
    other = replace(CLAIM, better="md-0.5", worse="fdc")
    records = arms(tmp_path, HIGH, LOW)
    records += [
        write_run(tmp_path, arm, seed, status="diverged")
        for arm in ("md-0.5", "fdc")
        for seed in range(1, 7)
    ]
    found = judge_claims([CLAIM, other], summarise(records), asking(CLAIM, other))
    assert [each.verdict for each in found] == ["supported", "undecided"]
    assert found[1].reason == "all runs of md-0.5 and fdc broke down"


def test_who_overrides_one_arm_has_no_verdict_on_the_others(tmp_path: Path) -> None:
    """Else its claims, taken out of the family, would make every other p smaller."""
    other = replace(CLAIM, better="md-0.5", worse="fdc")
    records = [*arms(tmp_path, HIGH, LOW), *write_arm(tmp_path, "fdc", LOW)]
    records += write_arm(tmp_path, "md-0.5", HIGH, overrides=["variants.md-0.5.algorithm.rate=0.6"])
    [first, second] = judge_claims([CLAIM, other], summarise(records), asking(CLAIM, other))
    assert (first.verdict, second.verdict) == ("undecided", "undecided")
    assert first.reason.startswith("1 of the 2 claims of its family")


def test_the_look_of_its_own_is_told_where_the_sign_is_from(tmp_path: Path) -> None:
    """A set with another claim crossed later, when the mean of the first had turned."""
    rule = Registration(looks=(6, 10), alpha_spent=(0.04, 0.1))
    turned, other = [3] * 6 + [-8] * 4, [3] * 5 + [-3] + [50] * 4
    base = [50] * 10
    records = arms(tmp_path, [b + d for b, d in zip(base, turned, strict=True)], base)
    records += write_arm(tmp_path, "fdc", [b + d for b, d in zip(base, other, strict=True)])
    claims = [CLAIM, replace(CLAIM, better="fdc", worse="dcc")]
    first, _ = judge_claims(claims, summarise(records), replace(asking(*claims), registration=rule))
    assert first.verdict == "supported"
    assert first.difference == pytest.approx(-1.4)
    assert "by itself it crossed at look 1" in first.reason


@pytest.mark.parametrize(
    ("better", "worse", "then"), [(HIGH, LOW, "supported"), (LOW, HIGH, "contradicted")]
)
def test_a_family_is_judged_once_it_is_whole(
    tmp_path: Path, better: list[int], worse: list[int], then: str
) -> None:
    """Claims that are run first would otherwise be looked at twice; another game waits for none."""
    other = replace(CLAIM, worse="fdc")
    elsewhere = replace(other, environment="pursuit-n8")
    claims = [CLAIM, other, elsewhere]
    records = arms(tmp_path, better, worse)
    part, missing, _ = judge_claims(claims, summarise(records), asking(*claims))
    assert (part.verdict, missing.verdict) == ("undecided", "not run")
    assert part.reason.startswith(
        "1 of the 2 claims of its family, which are judged together, cannot be compared here;"
        " look 1"
    )
    whole = [*records, *write_arm(tmp_path, "fdc", worse)]
    found = judge_claims(claims, summarise(whole), asking(*claims))
    assert [each.verdict for each in found] == [then, then, "not run"]


def test_one_side_cannot_be_contradicted(tmp_path: Path) -> None:
    """Registered so, six seeds that agree have a p of 1 / 64."""
    rule = replace(AT_SIX, sides=1)
    assert verdict_on(arms(tmp_path / "1", HIGH, LOW), rule=rule).verdict == "supported"
    verdict = verdict_on(arms(tmp_path / "2", LOW, HIGH), rule=rule)
    assert verdict.verdict == "undecided"
    assert verdict.evidence is not None
    assert (verdict.evidence.p, verdict.evidence.smallest_p) == (1.0, 1 / 64)


def test_one_side_says_at_any_stop_what_has_no_interval_yet(tmp_path: Path) -> None:
    """Five seeds that agree are worth 23 to who bets on one side; the interval takes both."""
    records = arms(tmp_path, [11] * 5, [1] * 5)
    verdict = verdict_on(records, rule=replace(AT_SIX, sides=1))
    assert verdict.anytime is not None
    assert verdict.anytime.interval is None
    assert "; at any stop, alone: p 0.043; 10 of the runs" in verdict.reason


def test_without_a_registration_there_are_estimates_only(tmp_path: Path) -> None:
    """However clear: nobody said beforehand when to look."""
    verdict = verdict_on(arms(tmp_path, HIGH, LOW), rule=None)
    assert (verdict.verdict, verdict.difference) == ("estimate", 10.0)
    assert verdict.reason.startswith("the question has no [registration]")


@pytest.mark.parametrize(("count", "look"), [(1, "first registered look at 6"), (5, "first")])
def test_before_the_first_look_there_are_estimates_only(
    tmp_path: Path, count: int, look: str
) -> None:
    """However clear the difference."""
    verdict = verdict_on(arms(tmp_path, [9] * count, [1] * count))
    assert (verdict.verdict, verdict.difference, verdict.seeds) == ("undecided", 8.0, count)
    assert verdict.reason.startswith(look)
    assert verdict.evidence is None


def test_seeds_after_a_look_change_the_estimate_and_no_verdict(tmp_path: Path) -> None:
    """Seven seeds: the word is of the first six, the difference of all."""
    verdict = verdict_on(arms(tmp_path, [*HIGH, 2], [*LOW, 12]))
    assert (verdict.verdict, verdict.seeds) == ("supported", 7)
    assert verdict.difference == pytest.approx((60 - 10) / 7)
    assert verdict.evidence is not None
    assert (verdict.evidence.look, verdict.evidence.seeds) == (1, 6)
    assert "the difference is of all 7 seeds" in verdict.reason


def test_a_look_is_of_the_first_seeds(tmp_path: Path) -> None:
    """Six seeds of which one has another number are not seeds 1 to 6: nobody picks them."""
    records = arms(tmp_path, [*HIGH, 11], [*LOW, 1])
    verdict = verdict_on([record for record in records if record.seed != 3])
    assert (verdict.verdict, verdict.seeds) == ("undecided", 6)
    assert "first registered look at 6 seeds, seed 3 is missing" in verdict.reason


def test_pairs_go_by_seed(tmp_path: Path) -> None:
    """A gain of 1 over seeds that differ by 10 is seen by pairs only."""
    worse = [0, 10, 20, 30, 40, 50]
    verdict = verdict_on(arms(tmp_path, [value + 1 for value in worse], worse))
    assert (verdict.verdict, verdict.interval) == ("supported", (1.0, 1.0))


def test_lower_is_better_where_it_is(tmp_path: Path) -> None:
    """Fewer steps to finish speak for the claim; the difference is turned accordingly."""
    tags = {"count": "catches", "per": "episodes", "scale": 1.0, "better": "lower", "meaning": "x"}
    records = arms(tmp_path, LOW, HIGH, metrics={"catches_per_500": tags})
    verdict = verdict_on(records)
    assert (verdict.verdict, verdict.difference) == ("supported", 5.0)


def test_an_interval_within_the_margin_is_level(tmp_path: Path) -> None:
    """A look of 12 seeds: the interval that counts looks and family is within 1 of 0."""
    rule = Registration(looks=(12,), alpha_spent=(0.05,), margin={"catches_per_500": 1.0})
    better, worse = [10, 11] * 6, [11, 10] * 6
    level = verdict_on(arms(tmp_path / "1", better, worse), rule=rule)
    assert (level.verdict, level.difference) == ("level", 0.0)
    assert level.reason.endswith(
        "surely within 1 of 0; 24 of the runs were planned before "
        f"{registered_as(asking(CLAIM, rule=rule), 'pursuit-n6')} was registered, or by another"
        " question"
    )
    wide = verdict_on(arms(tmp_path / "2", [10, 20] * 6, [20, 10] * 6), rule=rule)
    assert wide.verdict == "undecided"
    without = replace(rule, margin={})
    assert verdict_on(arms(tmp_path / "3", better, worse), rule=without).verdict == "undecided"


def test_claims_of_a_family_share_what_is_spent(tmp_path: Path) -> None:
    """A claim that is decided alone is not beside five of which nothing is true."""
    rule = Registration(looks=(6,), alpha_spent=(0.05,))
    others = [[9, 1, 8, 2, 7, 3], [3, 9, 1, 8, 2, 7], [1, 2, 9, 9, 2, 1], [9, 9, 9, 1, 1, 2]]
    records = arms(tmp_path, [9, 5, 12, 4, 20, 5], [4, 4, 4, 4, 4, 4])
    alone = verdict_on(records, replace(CLAIM, worse="dcc"), rule)
    claims = [CLAIM]
    for rank, values in enumerate(others):
        records += write_arm(tmp_path, f"other-{rank}", values)
        claims.append(replace(CLAIM, better=f"other-{rank}"))
    together = judge_claims(claims, summarise(records), asking(*claims, rule=rule))[0]
    assert alone.evidence is not None
    assert together.evidence is not None
    assert alone.evidence.p == together.evidence.p == alone.evidence.p_family
    assert together.evidence.p < together.evidence.p_family
    assert together.evidence.p_holm == 5 * together.evidence.p


def test_measures_are_families_of_their_own(tmp_path: Path) -> None:
    """Claims in training and after it are of different figures."""
    claims = [CLAIM, replace(CLAIM, measure="learning")]
    found = judge_claims(claims, summarise(arms(tmp_path, HIGH, LOW)), asking(*claims))
    assert [each.evidence.p_holm for each in found if each.evidence] == [0.03125, 1.0]


def test_a_changed_registration_is_told(tmp_path: Path) -> None:
    """Runs that were trained under another one, or under none; those under this one are not."""
    this = registered_as(asking(CLAIM), "pursuit-n6")
    records = arms(tmp_path, HIGH, LOW)
    for number, name in enumerate([None] * 3 + ["test:00000000"] * 2 + [this] * 7):
        records[number] = replace(
            records[number], run={**records[number].run, "registration": name}
        )
    assert verdict_on(records).reason.endswith(
        f"3 of the runs were planned before {this} was registered, or by another question; "
        f"2 of the runs were trained under test:00000000, not {this}"
    )
