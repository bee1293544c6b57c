"""The claims of one family judged together, as their question has registered it."""

from collections.abc import Sequence
from dataclasses import replace

from msgdrop_cli.analysis.e_process import Anytime, anytime
from msgdrop_cli.analysis.intervals import ALPHA, flip_interval, mean_interval
from msgdrop_cli.analysis.pairs import Pair
from msgdrop_cli.analysis.prospects import Prospect, no_forecast, prospect
from msgdrop_cli.analysis.sequential import decided, deciding_looks, flips_of, speaks_at
from msgdrop_cli.analysis.sign_flips import (
    Flipped,
    holm,
    p_value,
    sampling_error,
    smallest_p,
    step_down,
)
from msgdrop_cli.analysis.statistics import mean
from msgdrop_cli.analysis.verdict import Evidence, Verdict, Word
from msgdrop_cli.definition.spec import Registration

_NOT_REGISTERED = "the question has no [registration] of looks and alpha"


def judge_family(
    pairs: Sequence[Pair], rule: Registration | None, lacking: int = 0
) -> list[Verdict]:
    """One verdict for each pair of arms, in their order; without a registration an estimate.

    lacking: claims of the family that lack a run or an evaluation, which any look waits for.
    """
    if rule is None:
        return [_estimate(pair) for pair in pairs]
    flips = flips_of([[pair.at(seeds) for pair in pairs] for seeds in rule.looks], rule)
    if lacking and flips:
        return _withheld(pairs, flips, rule, lacking)
    when = decided(flips, rule) or [None] * len(pairs)
    found = [_evidence(each, number, rule) for number, each in enumerate(flips)]
    verdicts = []
    for number, (pair, look) in enumerate(zip(pairs, when, strict=True)):
        word: Word = "undecided"
        reached = len(flips) if look is None else look
        told: list[str] = []
        if (level := _level_at(pair, reached, rule, len(pairs))) is not None:
            word, look = "level", level
        elif look is not None:
            spoke = speaks_at(number, flips, rule)
            word = "supported" if mean(pair.at(rule.looks[spoke])) > 0.0 else "contradicted"
            told = [f"by itself it crossed at look {spoke + 1}"] if spoke < look else []
        elif reached:
            look = reached - 1
        evidence = None if look is None else found[look][number]
        ahead = prospect(pair, reached, rule, len(pairs)) if word == "undecided" else None
        stopped = anytime(pair.one_by_one(), rule.sides)
        told += _said_at(pair, reached, rule, ahead) if word == "undecided" else []
        reason = "; ".join(_reasons(pair, word, evidence, rule, told, stopped))
        unforeseen = no_forecast(pair, rule) if word == "undecided" and not ahead else ""
        verdict = _verdict(pair, word, reason, stopped, evidence, ahead)
        verdicts.append(replace(verdict, unforeseen=unforeseen))
    return verdicts


def _withheld(
    pairs: Sequence[Pair], flips: Sequence[Flipped], rule: Registration, lacking: int
) -> list[Verdict]:
    """What a look says of a part of the family: no verdict, or these claims would have two."""
    count = f"{lacking} of the {lacking + len(pairs)} claims of its family, which are judged"
    waits = f"{count} together, cannot be compared here"
    verdicts = []
    for pair, evidence in zip(pairs, _evidence(flips[-1], len(flips) - 1, rule), strict=True):
        stopped = anytime(pair.one_by_one(), rule.sides)
        reasons = [waits, *_reasons(pair, "undecided", evidence, rule, [], stopped)]
        verdict = _verdict(pair, "undecided", "; ".join(reasons), stopped)
        verdicts.append(replace(verdict, unforeseen="its family is not whole"))
    return verdicts


def _estimate(pair: Pair) -> Verdict:
    """What can be said of a claim whose looks nobody has registered."""
    stopped = anytime(pair.one_by_one(), sides=2)
    return _verdict(pair, "estimate", "; ".join([_NOT_REGISTERED, *_at_any_stop(stopped)]), stopped)


def _verdict(
    pair: Pair,
    word: Word,
    reason: str,
    stopped: Anytime | None,
    evidence: Evidence | None = None,
    ahead: Prospect | None = None,
) -> Verdict:
    values = [*pair.differences.values()]
    return Verdict(
        claim=pair.claim,
        verdict=word,
        reason=reason,
        group=pair.group,
        difference=mean(values) if values else None,
        interval=mean_interval(values) if values else None,
        seeds=len(values),
        lost=pair.lost,
        evidence=evidence,
        anytime=stopped,
        prospect=ahead,
    )


def _evidence(flips: Flipped, number: int, rule: Registration) -> list[Evidence | None]:
    """The numbers of every claim that has this look's seeds."""
    seeds = rule.looks[number]
    there = [claim for claim, row in enumerate(flips.statistics) if row[0] > float("-inf")]
    alone = [p_value(flips.statistics[claim]) for claim in there]
    family = step_down(flips.statistics)
    found: list[Evidence | None] = [None] * len(flips.statistics)
    for claim, p, p_holm in zip(there, alone, holm(alone), strict=True):
        found[claim] = Evidence(
            look=number + 1,
            seeds=seeds,
            p=p,
            p_family=family[claim],
            p_holm=p_holm,
            smallest_p=smallest_p(seeds, rule.sides),
            sampling_error=sampling_error(p, seeds),
            alpha_spent=rule.alpha_spent[number],
            alpha=rule.alpha,
        )
    return found


def _level_at(pair: Pair, reached: int, rule: Registration, family: int) -> int | None:
    """The first look at which the difference is surely within the margin, or None.

    Its interval leaves out what the look may spend, shared by the family: so at most alpha of all
    studies call a difference level that is not. A value in place of a lost run shows no equality.
    """
    margin = rule.margin.get(pair.claim.metric)
    if margin is None:
        return None
    for number in range(reached):
        if number < rule.looks_gone or not pair.is_whole(rule.looks[number]):
            continue
        interval = flip_interval(pair.at(rule.looks[number]), rule.share(number) / family)
        if interval and -margin <= interval.low and interval.high <= margin:
            return number
    return None


def _reasons(
    pair: Pair,
    word: Word,
    evidence: Evidence | None,
    rule: Registration,
    ahead: Sequence[str],
    stopped: Anytime | None,
) -> list[str]:
    """Why it is this word; ahead: what is said of looks to come."""
    parts = [_said_of(evidence)] if evidence else []
    if evidence and evidence.seeds < len(pair.differences):
        parts.append(f"the difference is of all {len(pair.differences)} seeds")
    if evidence and evidence.look <= rule.looks_gone:
        parts.append("looked at before it was registered, so that alpha is gone")
    if word == "level":
        margin = rule.margin[pair.claim.metric]
        parts.append(f"surely within {margin:g} of 0")
    parts += [*ahead, *_at_any_stop(stopped)]
    if pair.lost:
        parts.append(
            f"{pair.lost} lost to failed or diverged runs, which count as the worst:"
            " at a look of its seeds, in the difference of all"
        )
    if pair.overridden:
        parts.append(f"both with {', '.join(pair.overridden)}")
    return parts


def _said_of(evidence: Evidence) -> str:
    error = f" (drawn, +- {evidence.sampling_error:.1g})" if evidence.sampling_error else ""
    return (
        f"look {evidence.look}, seeds 1 to {evidence.seeds}: p {evidence.p:.2g}{error},"
        f" smallest possible {evidence.smallest_p:.2g}, in its family {evidence.p_family:.2g}"
        f" (Holm {evidence.p_holm:.2g}); alpha spent {evidence.alpha_spent:g} of {evidence.alpha:g}"
    )


def _at_any_stop(stopped: Anytime | None) -> list[str]:
    """What needs no look, if it says something: the claim alone, whoever stopped when."""
    if stopped is None or stopped.p > ALPHA:
        return []
    said = f"at any stop, alone: p {stopped.p:.2g}"
    if stopped.interval is not None:
        low, high = stopped.interval
        said += f", difference of {stopped.seeds} seeds [{low:.3g}, {high:.3g}]"
    return [said]


def _said_at(pair: Pair, reached: int, rule: Registration, ahead: Prospect | None) -> list[str]:
    """Where the next look is, and what would probably decide an open claim."""
    return [
        _next_look(pair, reached, rule),
        _in_words(ahead, rule) if ahead else no_forecast(pair, rule),
    ]


def _next_look(pair: Pair, reached: int, rule: Registration) -> str:
    if reached == len(rule.looks):
        return "no look is left"
    name, seeds = "next" if reached else "first", rule.looks[reached]
    missing, waits = pair.unbroken + 1, ""
    if missing > seeds:
        waits = ", which all claims of its family must have, for they are judged together"
    elif missing in pair.failed:
        waits = f", seed {missing} has failed and is to be trained again"
    elif missing <= len(pair.differences):
        waits = f", seed {missing} is missing"
    able = [look for look in deciding_looks(rule) if look >= seeds]
    if able and able[0] > seeds:
        waits += f", which can decide nothing: {able[0]} can"
    return f"{name} registered look at {seeds} seeds{waits}"


def _in_words(ahead: Prospect, rule: Registration) -> str:
    beyond = "" if ahead.registered else f", more than the {rule.looks[-1]} that are registered"
    return f"{ahead.seeds} would probably decide{beyond}"
