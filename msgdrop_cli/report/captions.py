"""The words around a figure: what it was made from and how its marks are to be read."""

from collections.abc import Sequence

from msgdrop_cli.analysis.intervals import FEWEST
from msgdrop_cli.analysis.provenance import short_commit
from msgdrop_cli.analysis.summary import Arm, Group, Summary


def scale(group: Group) -> str:
    """What no number may be shown without: environment, training length, profile."""
    return f"{group.environment}, {group.train_env_steps:,} env steps, {group.profile} profile"


def footer(
    summary: Summary, group: Group, arms: Sequence[Arm], measure: str, *, lost: str = "left out"
) -> str:
    """What the drawn arms of a group were made from, then how their numbers are to be read.

    lost: what becomes of failed and diverged runs in these numbers.
    """
    seeds = {tuple(record.seed for record in arm.done) for arm in arms}
    counts = sorted({len(each) for each in seeds})
    if len(seeds) == 1:
        shown = f"seed{'s' * (counts[0] > 1)} {_numbers(*seeds)}"
    elif len(counts) == 1:
        shown = f"{counts[0]} seed{'s' * (counts[0] > 1)} a variant, not the same"
    else:
        shown = f"{counts[0]} to {counts[-1]} seeds a variant"
    broken = sum(arm.failed + arm.diverged for arm in summary.arms_of(group))
    commits = sorted({short_commit(run.run.get("commit")) for arm in arms for run in arm.done})
    overrides = dict.fromkeys(each for arm in arms for each in arm.overrides)
    facts = [
        group.environment,
        f"profile {group.profile}",
        f"{group.train_env_steps:,} env steps a run",
        *([f"overridden: {', '.join(overrides)}"] if overrides else []),
        shown,
        *([origin] if (origin := summary.origin_of(group)) else []),
        *([f"{broken} failed or diverged run{'s' * (broken > 1)} {lost}"] if broken else []),
        f"commit{'s' * (len(commits) > 1)} {', '.join(commits)}",
    ]
    return " · ".join(facts) + "\n" + measure


def _numbers(numbers: Sequence[int]) -> str:
    """`1 to 7` for a run of at least three, else all of them."""
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"{numbers[0]} to {numbers[-1]}"
    return ", ".join(map(str, numbers))


def spread_note(seeds: set[int], mean_mark: str, spread_mark: str) -> str:
    """What the marks mean for these numbers of seeds."""
    notes = []
    if max(seeds) >= FEWEST:
        notes.append(f"{spread_mark}: 95% interval of the mean, inverted sign-flips")
    if few := sorted(count for count in seeds if 1 < count < FEWEST):
        numbers = " or ".join(map(str, few))
        notes.append(f"{spread_mark}: lowest to highest ({numbers} seeds)")
    if 1 in seeds:
        notes.append(f"1 seed: no {spread_mark}")
    return f"{mean_mark.capitalize()}: mean over seeds; {'; '.join(notes)}."
