"""The paper's orderings against our runs: supported, contradicted, or undecided and why.

A verdict needs at least six seeds in each arm: with fewer no two-sided sign-flip test of paired
seeds can reach 5% (2 / 2^n is 6.25% at n = 5). Six is a floor, not comfort: between equal arms of
normal data the paired percentile interval excludes 0 by chance in 12% of the cases at 7 seeds.
Groups (environment, length, profile) are judged apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from msgdrop_cli.analysis.curves import learning_mean
from msgdrop_cli.analysis.labels import without_variant
from msgdrop_cli.analysis.statistics import bootstrap_interval, difference_interval, mean
from msgdrop_cli.analysis.summary import Arm, Group, Summary
from msgdrop_cli.definition.spec import Claim

if TYPE_CHECKING:
    from numpy.random import Generator

MINIMUM_SEEDS = 6

Word = Literal["supported", "contradicted", "undecided"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What the runs say about one claim in one group."""

    claim: Claim
    verdict: Word
    reason: str
    group: Group | None = None
    """None when no group has a run of the claim's variants."""
    difference: float | None = None
    """Mean of `better` minus mean of `worse`, turned so that above 0 speaks for the claim."""
    low: float | None = None
    high: float | None = None
    """95% bootstrap interval of the difference; None where an arm has one seed."""
    seeds: int = 0
    """Seeds of the smaller arm."""
    paired: bool = False
    """Both arms have the same seeds, hence the same environment streams: differences by seed."""


def judge_claims(claims: Sequence[Claim], summary: Summary) -> list[Verdict]:
    """One verdict for each claim and each group of its environment that has one of its variants."""
    verdicts = []
    for claim in claims:
        groups = [
            group
            for group in summary.groups
            if group.environment == claim.environment
            and any(arm.variant in (claim.better, claim.worse) for arm in summary.arms_of(group))
        ]
        verdicts += [_judge_in(group, claim, summary) for group in groups]
        if not groups:
            reason = f"no run of {claim.better} or {claim.worse} on {claim.environment}"
            verdicts.append(Verdict(claim=claim, verdict="undecided", reason=reason))
    return verdicts


def judge(
    claim: Claim,
    better: Mapping[int, float],
    worse: Mapping[int, float],
    rng: "Generator",
    *,
    higher_is_better: bool = True,
) -> Verdict:
    """Judge one claim on each seed's value of the claim's metric (neither arm may be empty).

    Equal seed sets are paired and the differences bootstrapped; otherwise both arms are resampled.
    """
    sign = 1.0 if higher_is_better else -1.0
    paired = better.keys() == worse.keys()
    above, below = ([sign * value for value in arm.values()] for arm in (better, worse))
    if paired:
        pairs = [sign * (better[seed] - worse[seed]) for seed in better]
        interval = bootstrap_interval(pairs, rng)
    else:
        interval = difference_interval(above, below, rng)
    seeds = min(len(better), len(worse))
    kind = f"{seeds} paired seeds" if paired else f"{len(better)} against {len(worse)} seeds"
    word: Word = "undecided"
    if interval is None or seeds < MINIMUM_SEEDS:
        reason = f"{seeds} seed{'s' * (seeds != 1)}: at least {MINIMUM_SEEDS} are needed"
    elif interval.low <= 0.0 <= interval.high:
        reason = f"interval includes 0 ({kind})"
    else:
        word = "supported" if interval.low > 0.0 else "contradicted"
        reason = f"interval excludes 0 ({kind})"
    return Verdict(
        claim=claim,
        verdict=word,
        reason=reason,
        difference=mean(above) - mean(below),
        low=interval.low if interval else None,
        high=interval.high if interval else None,
        seeds=seeds,
        paired=paired,
    )


def _judge_in(group: Group, claim: Claim, summary: Summary) -> Verdict:
    """Find both arms in a group and judge them, or say what is missing."""
    import numpy as np

    found: list[tuple[Arm, Mapping[int, float]]] = []
    for variant in (claim.better, claim.worse):
        arms = [arm for arm in summary.arms_of(group) if arm.variant == variant]
        reason = ""
        if len(arms) > 1:
            reason = f"{variant} was trained with {len(arms)} different set-ups"
        elif not arms or not arms[0].done:
            reason = f"no {'finished ' * bool(arms)}run of {variant}"
        elif values := _values(claim, arms[0]):
            found.append((arms[0], values))
        else:
            reason = f"no {claim.metric} of {variant} ({_measured(claim)})"
        if reason:
            return Verdict(claim=claim, verdict="undecided", reason=reason, group=group)
    (better, better_values), (worse, worse_values) = found
    if {run.run_id for run in better.done} & {run.run_id for run in worse.done}:
        reason = f"{better.variant} and {worse.variant} are one run under two names"
        return Verdict(claim=claim, verdict="undecided", reason=reason, group=group)
    rng = np.random.default_rng(summary.bootstrap_seed)
    metric = better.metrics.find(claim.metric)
    higher = metric is None or metric.higher_is_better
    verdict = judge(claim, better_values, worse_values, rng, higher_is_better=higher)
    ahead = {"supported": better, "contradicted": worse}.get(verdict.verdict)
    if ahead and (lost := ahead.failed + ahead.diverged):
        # Leaving out the runs that broke down flatters an arm; it may lose by that, never win.
        reason = f"{ahead.variant} is ahead only without its {lost} failed or diverged runs"
        return replace(verdict, verdict="undecided", reason=reason, group=group)
    return replace(_as_overridden(verdict, better, worse), group=group)


def _as_overridden(verdict: Verdict, better: Arm, worse: Arm) -> Verdict:
    """The verdict with what was overridden: of both, it is told; of one, no claim was about it."""
    shared = [each for each in better.overrides if each in worse.overrides]
    for arm in (better, worse):
        if own := [each for each in arm.overrides if each not in shared]:
            settings = (without_variant(each, arm.variant) for each in own)
            reason = f"{arm.variant} was overridden: {', '.join(settings)}"
            return replace(verdict, verdict="undecided", reason=reason)
    told = f"{verdict.reason}; both with {', '.join(shared)}" if shared else verdict.reason
    return replace(verdict, reason=told)


def _values(claim: Claim, arm: Arm) -> Mapping[int, float]:
    """Each seed's value of what the claim compares; empty if it was never measured."""
    if claim.measure == "learning":
        means = {record.seed: learning_mean(record, claim.metric) for record in arm.done}
        return {seed: value for seed, value in means.items() if value is not None}
    row = arm.row(claim.metric, claim.channel)
    return row.by_seed if row else {}


def _measured(claim: Claim) -> str:
    if claim.measure == "learning":
        return "learning curve"
    return f"evaluation with {claim.channel.label}"
