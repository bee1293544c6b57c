"""Claims against runs: every verdict can be reached, and never on too little."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msgdrop_cli.analysis.claims import Verdict, judge, judge_claims
from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.spec import Claim
from tests.fake_runs import GROUP, write_arm, write_run

CLAIM = Claim(
    says="Dropout helps",
    source="l. 1",
    better="md-0.2",
    worse="dcc",
    environment="pursuit-n6",
    metric="catches_per_500",
)
LOW, HIGH = [1, 2, 1, 2, 1, 2], [11, 12, 12, 11, 12, 11]


def seeds(values: list[float]) -> dict[int, float]:
    """Values of seeds 1, 2, ..."""
    return dict(enumerate(values, start=1))


def verdict_on(records: Any, claim: Claim = CLAIM) -> Verdict:
    """The only verdict on these records."""
    (verdict,) = judge_claims([claim], summarise(records))
    return verdict


@pytest.mark.parametrize(
    ("better", "worse", "word"),
    [
        ([5.0, 6.0, 7.0, 8.0, 7.0, 6.0], [1.0, 2.0, 3.0, 4.0, 1.0, 2.0], "supported"),
        ([1.0, 2.0, 3.0, 4.0, 1.0, 2.0], [5.0, 6.0, 7.0, 8.0, 7.0, 6.0], "contradicted"),
        ([1.0, 8.0, 2.0, 7.0, 1.0, 8.0], [7.0, 2.0, 8.0, 1.0, 7.0, 2.0], "undecided"),
    ],
)
def test_interval_decides(better: list[float], worse: list[float], word: str) -> None:
    """A difference whose interval excludes 0 decides, in either direction."""
    verdict = judge(CLAIM, seeds(better), seeds(worse), np.random.default_rng(0))
    assert verdict.verdict == word
    assert verdict.difference == pytest.approx(sum(better) / 6 - sum(worse) / 6)


def test_difference_of_zero_is_undecided() -> None:
    """Equal arms touch 0 with both ends of the interval, which is not excluding it."""
    verdict = judge(CLAIM, seeds([2.0] * 6), seeds([2.0] * 6), np.random.default_rng(0))
    assert (verdict.verdict, verdict.low, verdict.high) == ("undecided", 0.0, 0.0)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_fewer_than_six_seeds_stay_undecided(count: int) -> None:
    """However clear the difference: with five pairs no sign-flip test reaches 5%."""
    verdict = judge(CLAIM, seeds([9.0] * count), seeds([1.0] * 6), np.random.default_rng(0))
    assert verdict.verdict == "undecided"
    assert verdict.reason == f"{count} seed{'s' * (count > 1)}: at least 6 are needed"
    assert verdict.difference == 8.0


def test_equal_seeds_are_paired() -> None:
    """A constant gain of 1 over seeds that differ by 100 is seen by pairs only."""
    worse = [0.0, 100.0, 200.0, 300.0, 400.0, 500.0]
    better = [value + 1.0 for value in worse]
    paired = judge(CLAIM, seeds(better), seeds(worse), np.random.default_rng(0))
    others = {seed + 10: value for seed, value in seeds(worse).items()}
    unpaired = judge(CLAIM, seeds(better), others, np.random.default_rng(0))
    assert (paired.paired, paired.verdict) == (True, "supported")
    assert (unpaired.paired, unpaired.verdict) == (False, "undecided")


def test_pairs_go_by_seed_not_by_order() -> None:
    """The order in which seeds are listed changes nothing."""
    backwards = dict(reversed(seeds([0.0, 10.0, 20.0, 30.0]).items()))
    forwards = seeds([1.0, 11.0, 21.0, 31.0])
    assert judge(CLAIM, forwards, backwards, np.random.default_rng(0)).low == pytest.approx(1.0)


def test_lower_is_better_where_it_is() -> None:
    """Fewer steps to finish speak for the claim; the difference is turned accordingly."""
    claim = replace(CLAIM, metric="steps_to_finish")
    fewer = seeds([90.0, 100.0, 110.0, 100.0, 90.0, 110.0])
    more = seeds([200.0, 210.0, 190.0, 220.0, 200.0, 210.0])
    rng = np.random.default_rng(0)
    verdict = judge(claim, fewer, more, rng, higher_is_better=False)
    assert verdict.verdict == "supported"
    assert verdict.difference == 105.0


def test_evaluation_is_compared_at_the_claims_broken_links(tmp_path: Path) -> None:
    """What counts is the channel that the claim names, not the unbroken one."""
    records = [
        write_run(tmp_path, variant, seed, catches={0.0: intact, 0.5: broken + seed % 2})
        for variant, intact, broken in (("dcc", 20, 1), ("md-0.2", 10, 5))
        for seed in range(1, 7)
    ]
    assert verdict_on(records).verdict == "contradicted"
    assert verdict_on(records, replace(CLAIM, channel=Channel.read("half"))).verdict == "supported"


def test_learning_compares_the_mean_of_the_curve(tmp_path: Path) -> None:
    """Who learns earlier wins on `learning` though both end level; nulls are left out."""
    records = [
        write_run(tmp_path, variant, seed, curve=[*early, 8.0], catches={0.0: 8})
        for variant, early in (("dcc", (0.0, 0.0, 4.0)), ("md-0.2", (None, 6.0, 7.0)))
        for seed in range(1, 7)
    ]
    assert verdict_on(records).verdict == "undecided"
    verdict = verdict_on(records, replace(CLAIM, measure="learning"))
    assert (verdict.verdict, verdict.difference) == ("supported", 4.0)  # 21/3 - 12/4


def test_a_missing_variant_is_named(tmp_path: Path) -> None:
    """Undecided says what has to be run."""
    verdict = verdict_on(write_arm(tmp_path, "dcc", LOW))
    assert (verdict.verdict, verdict.reason) == ("undecided", "no run of md-0.2")
    assert verdict.group == GROUP


def test_an_unfinished_variant_is_no_run(tmp_path: Path) -> None:
    """A run that is not done does not speak."""
    records = write_arm(tmp_path, "dcc", LOW) + write_arm(
        tmp_path, "md-0.2", HIGH, status="interrupted"
    )
    assert verdict_on(records).reason == "no finished run of md-0.2"


def test_no_run_at_all(tmp_path: Path) -> None:
    """Records of other variants leave a claim undecided, without a group."""
    verdict = verdict_on(write_arm(tmp_path, "fdc", LOW))
    assert verdict.reason == "no run of md-0.2 or dcc on pursuit-n6"
    assert verdict.group is None


def test_a_missing_evaluation_is_named(tmp_path: Path) -> None:
    """Runs that were never evaluated with these links say nothing about them."""
    records = write_arm(tmp_path, "dcc", LOW) + write_arm(tmp_path, "md-0.2", HIGH)
    verdict = verdict_on(records, replace(CLAIM, channel=Channel.read("half")))
    assert "no catches_per_500 of md-0.2 (evaluation with half of the links" in verdict.reason


def test_lengths_are_judged_apart(tmp_path: Path) -> None:
    """Short and long training give a verdict each, and may disagree."""
    records = [
        *write_arm(tmp_path, "dcc", LOW),
        *write_arm(tmp_path, "md-0.2", HIGH),
        *write_arm(tmp_path, "dcc", HIGH, train_env_steps=2000),
        *write_arm(tmp_path, "md-0.2", LOW, train_env_steps=2000),
    ]
    verdicts = judge_claims([CLAIM], summarise(records))
    assert [(v.group and v.group.train_env_steps, v.verdict) for v in verdicts] == [
        (1000, "supported"),
        (2000, "contradicted"),
    ]


def test_two_set_ups_of_a_variant_are_not_chosen_between(tmp_path: Path) -> None:
    """Nobody picks the setting that suits the claim."""
    records = [
        *write_arm(tmp_path, "dcc", LOW),
        *write_arm(tmp_path, "md-0.2", HIGH),
        *write_arm(tmp_path, "md-0.2", LOW, algorithm={"gamma": 0.9}),
    ]
    assert verdict_on(records).reason == "md-0.2 was trained with 2 different set-ups"


@pytest.mark.parametrize(("variant", "word"), [("md-0.2", "undecided"), ("dcc", "supported")])
def test_nobody_wins_by_leaving_out_runs_that_diverged(
    tmp_path: Path, variant: str, word: str
) -> None:
    """A diverged run of the arm that is ahead leaves it undecided; one of the loser does not."""
    records = write_arm(tmp_path, "dcc", LOW) + write_arm(tmp_path, "md-0.2", HIGH)
    records.append(write_run(tmp_path, variant, 7, status="diverged"))
    assert verdict_on(records).verdict == word


def test_no_claim_was_about_a_variant_that_was_overridden(tmp_path: Path) -> None:
    """What `--set` changed of one of the two leaves it undecided; the numbers stay."""
    records = write_arm(tmp_path, "dcc", LOW)
    records += write_arm(tmp_path, "md-0.2", HIGH, overrides=["variants.md-0.2.algorithm.rate=0.3"])
    verdict = verdict_on(records)
    assert (verdict.verdict, verdict.difference) == ("undecided", 10.0)
    assert verdict.reason == "md-0.2 was overridden: algorithm.rate=0.3"


def test_what_was_overridden_of_both_is_told(tmp_path: Path) -> None:
    """It is another scale, as a profile is."""
    both = {"overrides": ["algorithm.gamma=0.9"]}
    records = write_arm(tmp_path, "dcc", LOW, **both) + write_arm(tmp_path, "md-0.2", HIGH, **both)
    verdict = verdict_on(records)
    assert verdict.verdict == "supported"
    assert verdict.reason.endswith("(6 paired seeds); both with algorithm.gamma=0.9")


def test_one_run_under_two_names_is_not_compared_with_itself(tmp_path: Path) -> None:
    """Two questions may have published it, each by its own name."""
    records = write_arm(tmp_path, "dcc", LOW)
    records += [
        replace(record, run={**record.run, "variant": "md-0.2", "label": "MD"})
        for record in records
    ]
    verdict = verdict_on(records)
    assert verdict.verdict == "undecided"
    assert verdict.reason == "md-0.2 and dcc are one run under two names"
