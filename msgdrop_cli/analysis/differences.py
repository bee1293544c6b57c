"""What claims compare, as differences: over the training, point by point, and as pairs of arms."""

from collections.abc import Mapping, Sequence

from msgdrop_cli.analysis.curves import Curve, difference_of, learning_curve
from msgdrop_cli.analysis.pairs import Pair, find_pair
from msgdrop_cli.analysis.summary import Group, Summary
from msgdrop_cli.definition.load import list_askable, load_definition
from msgdrop_cli.definition.spec import Claim


def shipped_claims(summary: Summary) -> list[Claim]:
    """The claims of the shipped questions that runs of the summary were trained for, each once."""
    trained = {record.definition for arm in summary.arms for record in arm.done}
    names = sorted(trained & set(list_askable()))
    return list(dict.fromkeys(claim for name in names for claim in load_definition(name).claims))


def pairs_of(summary: Summary, group: Group, claims: Sequence[Claim]) -> list[Pair]:
    """Both arms of each claim about the group's headline; each comparison once, as first stated.

    Claims without runs, and those with runs of which no seed pairs, are in none.
    """
    headline = summary.metrics(group.environment).headline.name
    found: dict[tuple[object, ...], Pair] = {}
    for claim in claims:
        if claim.environment == group.environment and claim.metric == headline:
            pair = find_pair(group, claim, summary)
            if isinstance(pair, Pair) and pair.differences:
                key = (claim.better, claim.worse, claim.measure, claim.channel)
                found.setdefault(key, pair)
    return list(found.values())


def paired_curves(pairs: Sequence[Pair]) -> Mapping[tuple[str, str], Curve]:
    """By (better, worse): how much better while training, paired by seed; above 0 it is better.

    A seed with a run that broke down has no curve to its end and is in none. None for arms without
    a common seed or env step.
    """
    curves: dict[int, Curve | None] = {}
    found: dict[tuple[str, str], Curve] = {}
    for pair in pairs:
        name, both = pair.claim.metric, (pair.better, pair.worse)
        for arm in both:
            if id(arm) not in curves:
                curves[id(arm)] = learning_curve(arm.done, name)
        better, worse = (curves[id(arm)] for arm in both)
        metric = pair.better.metrics.find(name)
        sign = 1.0 if metric is None or metric.higher_is_better else -1.0
        if better and worse and (curve := difference_of(better, worse, sign)):
            found[pair.better.variant, pair.worse.variant] = curve
    return found
