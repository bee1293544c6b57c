"""What came out on pursuit: who catches how much, when links break, and while training."""

from collections.abc import Callable
from itertools import pairwise

from benchmarks.readme.judged import LABELS
from benchmarks.readme.studies import (
    ALL,
    HALF,
    NONE,
    SIX,
    difference,
    expect,
    number,
    ordinal,
    paragraph,
    study,
    table,
)
from msgdrop_cli.analysis.curves import learning_curve
from msgdrop_cli.analysis.statistics import mean

_BROKEN = "broken-links-two-million"
_BLOCKWISE = "blockwise-vs-elementwise-two-million"
_REMARKS = {
    "fdc": " (no messages)",
    "dcc": " (all messages)",
    "md-0.2": " (a fifth of the messages dropped)",
    "md-0.5": "",
    "sd-0.2": " (a fifth of their elements dropped)",
}
"""What the table says of its arms."""
_LAST = 200_000
"""Env steps at the end of the training that are told as where it ends."""


def seeds() -> str:
    """Under the figure on top."""
    count = len(study(_BROKEN, SIX).arm("dcc").done)
    return paragraph(
        f"""*Evader catches in 500 env steps on pursuit N = 6 when links break after training,
        {number(count)} seeds; the records behind every dot are in
        [`results/published/`](results/README.md).*"""
    )


def scale() -> str:
    """What the numbers of the table are."""
    arm = study(_BROKEN, SIX).arm("dcc")
    anneal = arm.setup["algorithm"]["epsilon_anneal_env_steps"]
    return paragraph(
        f"""Pursuit N = 6, {arm.group.train_env_steps:,} env steps a run, epsilon annealed over
        {anneal:,}, {number(len(arm.done))} seeds; catches per 500 env steps of the greedy policies,
        mean of the seeds [95% interval by inverted sign-flips],
        {study(_BROKEN, SIX).episodes("dcc"):,} episodes each."""
    )


def catches() -> str:
    """Catches of every variant with none, half and all of the links broken."""
    rows = []
    for variant, remark in _REMARKS.items():
        found = study(_BLOCKWISE if variant == "sd-0.2" else _BROKEN, SIX)
        first, *others = (found.after(variant, channel) for channel in (NONE, HALF, ALL))
        cells = (f"{each.mean:.1f}" if each == first else each.text(1) for each in others)
        rows.append((LABELS[variant] + remark, first.text(1), *cells))
    known = {name: f"{study(_BROKEN, SIX).reference(name):.1f}" for name in ("random", "nothing")}
    scripted = f"{study(_BROKEN, SIX).reference('scripted'):.1f}"
    nothing = ", ".join(dict.fromkeys(known.values()))
    return table(
        ("variant", "none of the links broken", "half", "all"),
        [
            *rows,
            ("random play, doing nothing", *[nothing] * 3),
            ("scripted, seeing everything", *[scripted] * 3),
        ],
    )


def claims() -> str:
    """What the paper says of broken links, and of elements."""
    found, blockwise = study(_BROKEN, SIX), study(_BLOCKWISE)
    verdicts = [each for each in found.verdicts if each.claim.channel != NONE]
    supported = {
        (v.claim.channel, v.claim.better, v.claim.worse)
        for v in verdicts
        if v.verdict == "supported"
    }
    expect(
        all(difference(each).mean > 0.0 for each in verdicts)
        and {each.verdict for each in verdicts} == {"supported", "undecided"}
        and supported
        == {
            *((HALF, better, "fdc") for better in ("md-0.2", "md-0.5")),
            *((ALL, better, "dcc") for better in ("md-0.2", "md-0.5")),
        },
        "which of the broken links' claims are supported",
    )
    [look] = {each.evidence.look for each in verdicts if each.evidence}
    rule = found.registration
    elements = blockwise.verdict("md-0.2", "sd-0.2")
    faster = blockwise.verdict("md-0.2", "dcc", measure="learning")
    return paragraph(
        f"""What the paper says of broken links points its way in all {number(len(verdicts))}
        comparisons, and at the {ordinal(look)} of {number(len(rule.looks))} registered looks
        {number(len(supported))} of them are **supported**: with half of the links broken DCC-MD
        0.2 and 0.5 are better than FDC, with all of them broken better than simple DCC. Undecided
        until the next look, at {rule.looks[look]} seeds: that with half broken both are better than
        simple DCC, and with all broken worse than FDC. That dropping whole messages beats dropping
        elements after training is **{elements.verdict}**, by {difference(elements).text(1)}
        catches; that DCC-MD 0.2 learns faster than simple DCC, by {difference(faster).text(1)} over
        the whole training, is **{faster.verdict}**. [Every claim, its p and what it was
        before](results/README.md#judged-again)."""
    )


def training() -> str:
    """Where the exploring policies end, and where FDC is overtaken."""
    found = study(_BROKEN, SIX)
    steps = found.arm("fdc").group.train_env_steps
    fdc, dcc, fifth, half = (
        f"{mean([*found.windows(each, steps - _LAST, steps).values()]):.1f}"
        for each in ("fdc", "dcc", "md-0.2", "md-0.5")
    )
    others = [_overtaken(each) for each in ("dcc", "md-0.2", "md-0.5")]
    first, last = min(others), max(others)
    expect(first > 1_000_000, "FDC is ahead at a million env steps")
    return paragraph(
        f"""FDC is fastest at first and stops at {fdc} catches while training (the mean over the
        last {_LAST:,} env steps), where DCC makes {dcc}, DCC-MD 0.2 {fifth} and DCC-MD 0.5 {half}.
        A throw-away prototype of the same rules, one seed each and a million env steps, ended with
        FDC ahead (15.3 against 10.2 and 7.3); so do these curves at a million, and cross it between
        {first / 1e6:.1f} and {last / 1e6:.1f} million."""
    )


def _overtaken(variant: str) -> int:
    """The env step from which on this variant's mean curve stays above FDC's."""
    ours, theirs = (
        learning_curve(study(_BROKEN, SIX).arm(each).done, "catches_per_500")
        for each in (variant, "fdc")
    )
    if ours is None or theirs is None:
        raise ValueError("no curve")
    ahead = [a > b for a, b in zip(ours.mean, theirs.mean, strict=True)]
    behind = [n for n, (a, b) in enumerate(pairwise(ahead), start=1) if b and not a]
    expect(ahead[-1] and bool(behind), f"{variant} overtakes FDC")
    return ours.env_steps[behind[-1]]


BLOCKS: dict[str, Callable[[], str]] = {
    "pursuit-seeds": seeds,
    "pursuit-scale": scale,
    "pursuit-catches": catches,
    "pursuit-claims": claims,
    "pursuit-training": training,
}
