"""The two arms of a claim, seed by seed: arms of one seed have met the same games, so they pair.

A run that failed or diverged has the worst value of the two arms, in place of one of its own:
leaving it out would flatter its arm. No look counts a failed one: training it again may end well.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count, takewhile
from typing import Literal, NamedTuple

from msgdrop_cli.analysis.curves import learning_mean
from msgdrop_cli.analysis.labels import without_variant
from msgdrop_cli.analysis.summary import Arm, Group, Summary
from msgdrop_cli.definition.spec import Claim


class Missing(NamedTuple):
    """Why there is no comparison."""

    word: Literal["not run", "undecided"]
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """What one claim compares in one group."""

    claim: Claim
    group: Group
    better: Arm
    worse: Arm
    differences: Mapping[int, float]
    """Of each seed that both arms have, in order: above 0 speaks for the claim."""
    lost: int
    """Seeds of which a run failed or diverged."""
    failed: frozenset[int]
    """Seeds of which a run failed, by the fault of a machine or program."""
    overridden: tuple[str, ...]
    """What `--set` changed of both arms."""

    @property
    def first(self) -> list[float]:
        """The differences of seeds 1, 2, ... up to the first that is missing, or has failed."""
        seeds = takewhile((self.differences.keys() - self.failed).__contains__, count(1))
        return [self.differences[seed] for seed in seeds]


def find_pair(group: Group, claim: Claim, summary: Summary) -> Pair | Missing:
    """Both arms of a claim in a group, or what is missing of them."""
    arms = []
    for variant in (claim.better, claim.worse):
        found = [arm for arm in summary.arms_of(group) if arm.variant == variant]
        if len(found) > 1:
            reason = f"{variant} was trained with {len(found)} different set-ups"
            return Missing("undecided", reason)
        if not found or not (found[0].done or found[0].lost):
            return Missing("not run", f"no {'finished ' * bool(found)}run of {variant}")
        arms.append(found[0])
    better, worse = arms
    if {run.run_id for run in better.done} & {run.run_id for run in worse.done}:
        reason = f"{better.variant} and {worse.variant} are one run under two names"
        return Missing("undecided", reason)
    shared = [each for each in better.overrides if each in worse.overrides]
    for arm in arms:
        if own := [each for each in arm.overrides if each not in shared]:
            settings = (without_variant(each, arm.variant) for each in own)
            return Missing("undecided", f"{arm.variant} was overridden: {', '.join(settings)}")
    for arm in arms:
        if arm.done and not _values(claim, arm):
            return Missing("not run", f"no {claim.metric} of {arm.variant} ({_measured(claim)})")
    if not any(arm.done for arm in arms):
        return Missing("undecided", f"all runs of {better.variant} and {worse.variant} broke down")
    return _paired(group, claim, better, worse, tuple(shared))


def _paired(
    group: Group, claim: Claim, better: Arm, worse: Arm, overridden: tuple[str, ...]
) -> Pair:
    metric = (better if better.done else worse).metrics.find(claim.metric)
    sign = 1.0 if metric is None or metric.higher_is_better else -1.0
    values = [
        {seed: sign * value for seed, value in _values(claim, arm).items()}
        for arm in (better, worse)
    ]
    worst = min(value for arm in values for value in arm.values())
    for arm, found in zip((better, worse), values, strict=True):
        found |= dict.fromkeys(arm.lost - found.keys(), worst)
    seeds = sorted(values[0].keys() & values[1].keys())
    return Pair(
        claim=claim,
        group=group,
        better=better,
        worse=worse,
        differences={seed: values[0][seed] - values[1][seed] for seed in seeds},
        lost=len((better.lost | worse.lost) & set(seeds)),
        failed=better.failed_seeds | worse.failed_seeds,
        overridden=overridden,
    )


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
