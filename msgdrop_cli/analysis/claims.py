"""The paper's orderings against our runs: every claim finds its arms, its family and its word.

There is a verdict only at the looks that the question has registered: each is of seeds 1 to n. What
was trained in between is an estimate. Groups (environment, length, profile) are judged apart, and
in a group the claims of one family together (`families`; `sequential` has the rule). Whoever sets
one arm to something else has no verdict on the others: they are a part of the family.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from msgdrop_cli.analysis.families import judge_family
from msgdrop_cli.analysis.pairs import Missing, Pair, find_pair
from msgdrop_cli.analysis.summary import Group, Summary
from msgdrop_cli.analysis.verdict import Verdict
from msgdrop_cli.definition.registration import registered_as
from msgdrop_cli.definition.spec import Claim, Definition


def judge_claims(
    claims: Sequence[Claim], summary: Summary, definition: Definition
) -> list[Verdict]:
    """One verdict for each claim and each group of its environment that has one of its variants.

    claims: those of the definition that the runs can judge; it says how. Families are those of all
    its claims: whoever asks for some of them would else choose which are judged together.
    """
    verdicts: dict[tuple[int, Group | None], Verdict] = {}
    families: dict[tuple[Group, tuple[str, str]], dict[int, Pair]] = {}
    never: Counter[tuple[Group, tuple[str, str]]] = Counter()
    for number, claim in enumerate(claims):
        groups = _groups_of(claim, summary)
        if not groups:
            reason = f"no run of {claim.better} or {claim.worse} on {claim.environment}"
            verdicts[number, None] = Verdict(claim=claim, verdict="not run", reason=reason)
        for group in groups:
            pair = find_pair(group, claim, summary)
            if isinstance(pair, Missing):
                verdicts[number, group] = Verdict(
                    claim=claim, verdict=pair.word, reason=pair.reason, group=group
                )
                never[group, claim.family] += pair.for_good
            else:
                families.setdefault((group, claim.family), {})[number] = pair
    rule, sizes = definition.registration, Counter(each.family for each in definition.claims)
    for (group, family), pairs in families.items():
        name = registered_as(definition, group.environment)
        known = rule and rule.in_game(group.environment)
        lacking = sizes[family] - len(pairs) - never[group, family]
        judged = judge_family([*pairs.values()], known, lacking)
        for (number, pair), verdict in zip(pairs.items(), judged, strict=True):
            verdicts[number, group] = _with_registrations(verdict, pair, name)
    return [verdicts[key] for key in sorted(verdicts, key=lambda key: (key[0], key[1] or ()))]


def _groups_of(claim: Claim, summary: Summary) -> list[Group]:
    return [
        group
        for group in summary.groups
        if group.environment == claim.environment
        and any(arm.variant in (claim.better, claim.worse) for arm in summary.arms_of(group))
    ]


def _with_registrations(verdict: Verdict, pair: Pair, name: str | None) -> Verdict:
    """The verdict, telling which of its runs were not planned under this registration."""
    if name is None:
        return verdict
    others = Counter(
        record.registration
        for arm in (pair.better, pair.worse)
        for record in arm.done
        if record.registration != name
    )
    told = [
        f"{count} of the runs were planned before {name} was registered, or by another question"
        if other is None
        else f"{count} of the runs were trained under {other}, not {name}"
        for other, count in sorted(others.items(), key=lambda each: each[0] or "")
    ]
    return replace(verdict, reason="; ".join([verdict.reason, *told]))
