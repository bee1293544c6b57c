"""What came out on navigation, in both orders of the landmarks."""

from collections.abc import Callable

from benchmarks.readme.judged import LABELS, NAVIGATION
from benchmarks.readme.readings import HUBER, TARGET, with_huber, with_target
from benchmarks.readme.studies import (
    Study,
    difference,
    evidence,
    expect,
    number,
    paragraph,
    study,
    table,
)
from msgdrop_cli.analysis.statistics import mean

_NUMBERED = "navigation-half-million"
_FEW, _MANY = "navigation-n8", "navigation-n10"
_LAST = 25_000
"""Env steps at the end of the training of the landmarks as numbered."""


def returns() -> str:
    """Returns of every variant in the three settings, beside policies that learn nothing."""
    numbered, nearest = study(_NUMBERED), study(NAVIGATION)
    columns = ((numbered, _FEW), (nearest, _FEW), (nearest, _MANY))
    rows = [
        (LABELS[variant], *(_return(each, variant, game) for each, game in columns))
        for variant in ("fdc", "dcc", "md-0.2", "md-0.5")
    ]
    for says, names in (
        ("random play, doing nothing", ("random", "nothing")),
        ("scripted, looking four steps ahead", ("scripted",)),
    ):
        cells = [[_reference(each, name, game) for name in names] for each, game in columns]
        rows.append((says, *map(", ".join, cells)))
    first, second = (each.arm("fdc", _FEW) for each in (numbered, nearest))
    third = nearest.arm("fdc", _MANY)
    steps = [f"{each.group.train_env_steps:,}" for each in (first, second)]
    return table(
        (
            "policy",
            f"N = 8 as numbered, {steps[0]} env steps, {len(first.done)} seeds",
            f"N = 8 nearest first, {steps[1]}, {len(second.done)} seeds",
            f"N = 10 nearest first, {steps[1]}, {len(third.done)} seeds",
        ),
        rows,
    )


def claim() -> str:
    """The paper's one sentence about navigation."""
    found = study(NAVIGATION)
    learning = [each for each in found.verdicts if each.claim.measure == "learning"]
    few = [each for each in learning if each.claim.environment == _FEW]
    [worse] = [each for each in learning if each.verdict == "contradicted"]
    after = [each for each in found.verdicts if each.claim.measure == "evaluation"]
    supported = sum(each.verdict == "supported" for each in learning)
    expect(
        supported == len(learning) - 1
        and {each.verdict for each in few} == {"supported"}
        and (worse.claim.environment, worse.claim.better, worse.claim.worse)
        == (_MANY, "md-0.5", "dcc")
        and {each.verdict for each in after} == {"undecided"},
        "which of navigation's claims are supported",
    )
    looks = found.registration.looks
    following = {each.claim.environment: looks[evidence(each).look] for each in after}
    scripted = " and ".join(_reference(found, "scripted", game) for game in (_FEW, _MANY))
    return paragraph(
        f"""The claim of the paper (l. 430), *DCC-MD with rates 0.2 and 0.5 outperforms simple DCC
        and FDC*, is **supported** while training, in all {number(len(few))} comparisons of N = 8
        and in {number(supported - len(few))} of N = 10. The {_fourth(len(learning) - len(few))} is
        **{worse.verdict}**: with ten agents DCC-MD 0.5 learns a little worse than simple DCC (by
        {difference(worse).negated.text(1)}). That DCC-MD 0.2 learns better than it there depends on
        [the loss](#published{HUBER}) and on [the target network](#published{TARGET}). After
        training it is **{after[0].verdict}** everywhere; the next look is at {following[_FEW]}
        seeds for N = 8, at {following[_MANY]} for N = 10. The differences are small against what is
        left to learn: a scripted policy that looks four steps ahead returns {scripted}."""
    )


def numbered() -> str:
    """Where the runs with the landmarks as numbered end."""
    found = study(_NUMBERED)
    steps = found.arm("fdc").group.train_env_steps
    nothing = found.reference("nothing")
    last = [
        mean([*found.windows(each, steps - _LAST, steps).values()])
        for each in ("fdc", "dcc", "md-0.2")
    ]
    fdc, dcc, fifth = (f"{value:.1f}" for value in last)
    below = round(nothing - last[0])
    expect(
        min(last[1:]) > nothing - 2.0 and below >= 5,
        "DCC and DCC-MD level with doing nothing, FDC far below",
    )
    return paragraph(
        f"""Everybody falls below random play first, learns to keep away from the others, and ends
        near doing nothing ({nothing:.1f}): DCC and DCC-MD level with it, FDC {number(below)} below.
        A prototype of the same rules made -104.4 (FDC), -93.1 (DCC) and -92.6 (DCC-MD 0.2) at
        {steps:,} steps while training; here it is {fdc}, {dcc} and {fifth}, the means over the last
        {_LAST:,}."""
    )


def front() -> str:
    """Navigation on the front page."""
    found = study(NAVIGATION)
    with_huber()
    with_target()
    [worse] = [
        each
        for each in found.verdicts
        if each.claim.measure == "learning" and each.verdict != "supported"
    ]
    expect(
        (worse.claim.environment, worse.claim.better, worse.claim.worse)
        == (_MANY, "md-0.5", "dcc"),
        "what navigation's claims in training say",
    )
    supported = found.verdict("md-0.2", "dcc", environment=_FEW, measure="learning")
    seeds = number(evidence(supported).seeds)
    return paragraph(
        f"""In navigation with eight agents DCC-MD 0.2 and 0.5 learn better than FDC and DCC
        (**{supported.verdict}**, {seeds} seeds); with ten agents 0.5 learns worse than DCC
        (**{worse.verdict}**), and whether 0.2 learns better than it depends on the loss and on how
        often the target network follows (**under-specified**). That, waterworld, and which command
        made what: [`results/README.md`](results/README.md)."""
    )


def _return(found: Study, variant: str, game: str) -> str:
    known = {arm.variant for arm in found.summary.arms}
    return found.after(variant, environment=game).text() if variant in known else ""


def _reference(found: Study, name: str, game: str) -> str:
    """As short as the paper's numbers are: -42 and -54.5, and no decimals from 100 on."""
    value = found.reference(name, environment=game)
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.1f}".removesuffix(".0")


def _fourth(count: int) -> str:
    expect(count == 4, "there are four comparisons of N = 10")
    return "fourth"


BLOCKS: dict[str, Callable[[], str]] = {
    "navigation-returns": returns,
    "navigation-claim": claim,
    "navigation-numbered": numbered,
    "navigation-front": front,
}
