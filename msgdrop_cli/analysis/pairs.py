"""The two arms of a claim, seed by seed: arms of one seed have met the same games, so they pair.

A run that failed or diverged has the worst value of the two arms, in place of one of its own:
leaving it out would flatter its arm. A look at n seeds takes the worst of these n, so that no later
seed can change it. No look counts a failed run: training it again may end well.
"""

import math
from collections.abc import Collection, Mapping
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
    for_good: bool = False
    """Whether no run and no other setting can change it: its family does without it."""


class ArmValues(NamedTuple):
    """One arm's side of a pair; above is better."""

    values: Mapping[int, float]
    """By seed."""
    lost: frozenset[int]
    """Seeds that have none: their runs failed or diverged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """What one claim compares in one group."""

    claim: Claim
    group: Group
    better: Arm
    worse: Arm
    measured: tuple[ArmValues, ArmValues]
    """Of `better` and of `worse`."""
    failed: frozenset[int]
    """Seeds of which a run failed, by the fault of a machine or program."""
    overridden: tuple[str, ...]
    """What `--set` changed of both arms."""

    @property
    def differences(self) -> dict[int, float]:
        """Of each seed that both arms have, in order: above 0 speaks for the claim."""
        return _differences(self.measured, self._seeds)

    @property
    def lost(self) -> int:
        """How many of these have a run that failed or diverged."""
        return len([seed for seed in self._seeds if any(seed in a.lost for a in self.measured)])

    @property
    def unbroken(self) -> int:
        """How many seeds there are up to the first that is missing, or has failed."""
        usable = set(self._seeds) - self.failed
        return len([*takewhile(usable.__contains__, count(1))])

    def at(self, seeds: int) -> list[float]:
        """The differences of seeds 1 to n as a look at them sees them; fewer if not all are there.

        It knows nothing of later seeds, not even how bad they were.
        """
        seen = range(1, min(seeds, self.unbroken) + 1)
        return [*_differences(self.measured, seen).values()]

    def one_by_one(self) -> list[float]:
        """The unbroken differences, each as it was when its seed was the last one."""
        found, worst = list[float](), math.inf
        for seed in range(1, self.unbroken + 1):
            values = [arm.values[seed] for arm in self.measured if seed in arm.values]
            worst = min([worst, *values])
            better, worse = (arm.values.get(seed, worst) for arm in self.measured)
            found.append(better - worse if values else 0.0)
        return found

    def is_whole(self, seeds: int) -> bool:
        """Whether none of the runs of seeds 1 to n is lost."""
        return not any(seed <= seeds for arm in self.measured for seed in arm.lost)

    @property
    def _seeds(self) -> list[int]:
        better, worse = (arm.values.keys() | arm.lost for arm in self.measured)
        return sorted(better & worse)


def _differences(measured: tuple[ArmValues, ArmValues], seeds: Collection[int]) -> dict[int, float]:
    """Of these seeds; a lost run has the worst value that either arm has in them, if any has."""
    there = [arm.values[seed] for arm in measured for seed in seeds if seed in arm.values]
    worst = min(there, default=0.0)
    better, worse = measured
    return {seed: better.values.get(seed, worst) - worse.values.get(seed, worst) for seed in seeds}


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
        return Missing("undecided", reason, for_good=True)
    if better.done and worse.done and not better.played_with(worse):
        reason = f"{better.variant} and {worse.variant} played games of different settings"
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
        reason = f"all runs of {better.variant} and {worse.variant} broke down"
        return Missing("undecided", reason, for_good=True)
    return _paired(group, claim, better, worse, tuple(shared))


def _paired(
    group: Group, claim: Claim, better: Arm, worse: Arm, overridden: tuple[str, ...]
) -> Pair:
    metric = (better if better.done else worse).metrics.find(claim.metric)
    sign = 1.0 if metric is None or metric.higher_is_better else -1.0

    def measured(arm: Arm) -> ArmValues:
        values = {seed: sign * value for seed, value in _values(claim, arm).items()}
        return ArmValues(values, frozenset(arm.lost - values.keys()))

    return Pair(
        claim=claim,
        group=group,
        better=better,
        worse=worse,
        measured=(measured(better), measured(worse)),
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
