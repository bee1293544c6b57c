"""Which runs a claim compares, and what each of them counts as."""

from dataclasses import replace
from pathlib import Path

import pytest

from msgdrop_cli.analysis.claims import judge_claims
from msgdrop_cli.analysis.pairs import Pair, find_pair
from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.definition.channel import Channel
from tests.claims import AT_SIX, CLAIM, HIGH, LOW, asking, verdict_on
from tests.fake_runs import GROUP, write_arm, write_run


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
    assert verdict_on(records).verdict == "level"
    verdict = verdict_on(records, replace(CLAIM, measure="learning"))
    assert (verdict.verdict, verdict.difference) == ("supported", 4.0)  # 21/3 - 12/4


def test_a_missing_variant_is_named(tmp_path: Path) -> None:
    """It says what has to be run."""
    verdict = verdict_on(write_arm(tmp_path, "dcc", LOW))
    assert (verdict.verdict, verdict.reason) == ("not run", "no run of md-0.2")
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
    verdicts = judge_claims([CLAIM], summarise(records), asking(CLAIM))
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


@pytest.mark.parametrize(
    ("variant", "status", "word"),
    [
        ("md-0.2", "diverged", "undecided"),
        ("dcc", "diverged", "supported"),
        ("md-0.2", "failed", "undecided"),
        ("dcc", "failed", "undecided"),
    ],
)
def test_a_run_that_broke_down_has_the_worst_value(
    tmp_path: Path, variant: str, word: str, status: str
) -> None:
    """The arm that is ahead loses by it; no look counts a failed one, which may end well yet."""
    values = {"dcc": [1, 2, 1, 2, 1], "md-0.2": [11, 12, 12, 11, 12]}
    records = [run for name in values for run in write_arm(tmp_path, name, values[name])]
    other = "dcc" if variant == "md-0.2" else "md-0.2"
    records.append(write_run(tmp_path, variant, 6, status=status))
    records.append(write_run(tmp_path, other, 6, catches={0.0: {"dcc": 2, "md-0.2": 11}[other]}))
    verdict = verdict_on(records)
    assert (verdict.verdict, verdict.lost, verdict.seeds) == (word, 1, 6)
    assert verdict.difference == pytest.approx((51 + (10 if variant == "dcc" else -1)) / 6)
    waits = "first registered look at 6 seeds, seed 6 has failed and is to be trained again"
    assert (waits in verdict.reason) == (status == "failed")
    assert "1 lost to failed or diverged runs, which count as the worst" in verdict.reason


def test_no_later_seed_changes_what_a_lost_run_counts_for_at_a_look(tmp_path: Path) -> None:
    """Seed 7 is far worse: of all seeds seed 1 is now -102, which six seeds never heard of."""
    rule = replace(AT_SIX, alpha_spent=(0.07, 0.1))
    first = write_arm(tmp_path, "dcc", [2] * 6)
    first += [write_run(tmp_path, "md-0.2", 1, status="diverged")]
    first += [write_run(tmp_path, "md-0.2", seed, catches={0.0: 12}) for seed in range(2, 7)]
    first[0] = write_run(tmp_path / "1", "dcc", 1, catches={0.0: 3})  # the others' worst is 2
    later = [write_run(tmp_path, arm, 7, catches={0.0: -100}) for arm in ("dcc", "md-0.2")]
    early, late = (verdict_on(records, rule=rule) for records in (first, [*first, *later]))
    assert (early.verdict, late.verdict) == ("supported", "supported")
    assert early.evidence is not None
    assert early.evidence == late.evidence
    assert early.evidence.p == 4 / 64  # -1 against five times 10
    assert (early.difference, late.difference) == (49 / 6, (50 - 103) / 7)
    pair = find_pair(GROUP, CLAIM, summarise([*first, *later]))
    assert isinstance(pair, Pair)
    assert pair.at(6) == [-1.0, 10.0, 10.0, 10.0, 10.0, 10.0]
    assert pair.one_by_one() == [0.0, 10.0, 10.0, 10.0, 10.0, 10.0, 0.0]
    assert pair.at(7) == [-103.0, 10.0, 10.0, 10.0, 10.0, 10.0, 0.0]


def test_what_is_evidence_at_any_stop_takes_each_seed_as_it_came(tmp_path: Path) -> None:
    """Where all that came so far is lost, nothing speaks for anybody."""
    records = [write_run(tmp_path, arm, 1, status="diverged") for arm in ("dcc", "md-0.2")]
    records += [write_run(tmp_path, "dcc", seed, catches={0.0: 2}) for seed in (2, 3)]
    records += [write_run(tmp_path, "md-0.2", 2, catches={0.0: 5})]
    records += [write_run(tmp_path, "md-0.2", 3, status="diverged")]
    pair = find_pair(GROUP, CLAIM, summarise(records))
    assert isinstance(pair, Pair)
    assert pair.one_by_one() == [0.0, 3.0, 0.0]
    assert (pair.lost, pair.unbroken) == (2, 3)
    assert [pair.at(seed)[-1] for seed in (1, 2, 3)] == pair.one_by_one()


def test_an_arm_that_always_breaks_down_loses(tmp_path: Path) -> None:
    """`Full element-wise dropout fails to train` is no missing comparison."""
    records = write_arm(tmp_path, "md-0.2", HIGH)
    records += [write_run(tmp_path, "dcc", seed, status="diverged") for seed in range(1, 7)]
    verdict = verdict_on(records)
    assert verdict.lost == 6
    assert verdict.difference == pytest.approx(0.5)  # within the margin, which shows nothing
    assert verdict.verdict == "undecided"
    both = [write_run(tmp_path / "2", v, 1, status="failed") for v in ("dcc", "md-0.2")]
    assert verdict_on(both).reason == "all runs of md-0.2 and dcc broke down"


def test_no_claim_was_about_a_variant_that_was_overridden(tmp_path: Path) -> None:
    """What `--set` changed of one of the two leaves it undecided."""
    records = write_arm(tmp_path, "dcc", LOW)
    records += write_arm(tmp_path, "md-0.2", HIGH, overrides=["variants.md-0.2.algorithm.rate=0.3"])
    verdict = verdict_on(records)
    assert verdict.verdict == "undecided"
    assert verdict.reason == "md-0.2 was overridden: algorithm.rate=0.3"


def test_games_of_two_questions_are_compared_if_they_are_one(tmp_path: Path) -> None:
    """Whose scales are called alike: other settings of the game stand in the label, too."""
    far = {"environment": {"name": "pursuit-n6", "sight": 9}}
    records = write_arm(tmp_path, "dcc", LOW)
    records += [
        replace(record, run={**record.run, "spec": {**record.spec, **far}})
        for record in write_arm(tmp_path, "md-0.2", HIGH, definition="other")
    ]
    verdict = verdict_on(records)
    assert verdict.reason == "md-0.2 and dcc played games of different settings"
    assert [arm.label for arm in summarise(records).arms] == ["DCC", "MD-0.2 (sight=9)"]
    one = [replace(each, run={**each.run, "definition": "test"}) for each in records]
    assert verdict_on(one).verdict == "supported"


def test_what_was_overridden_of_both_is_told(tmp_path: Path) -> None:
    """It is another scale, as a profile is."""
    both = {"overrides": ["algorithm.gamma=0.9"]}
    records = write_arm(tmp_path, "dcc", LOW, **both) + write_arm(tmp_path, "md-0.2", HIGH, **both)
    verdict = verdict_on(records)
    assert verdict.verdict == "supported"
    assert "; both with algorithm.gamma=0.9" in verdict.reason


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
