"""What came out on the rates of message-dropout: figures 3a and 4a."""

from collections.abc import Callable

from benchmarks.readme.judged import counted
from benchmarks.readme.studies import (
    difference,
    expect,
    listing,
    number,
    ordinal,
    paragraph,
    study,
    while_and_after,
)

STUDY = "dropout-rate-two-million"
_RATES = {f"md-{rate}": f"DCC-MD {rate}" for rate in ("0.1", "0.2", "0.3", "0.4", "0.5")}
_LABELS = {"dcc": "DCC (rate 0)", **_RATES, "fdc": "FDC (no messages)"}


def catches() -> str:
    """Each rate while it learns, and after."""
    return while_and_after(study(STUDY), _LABELS)


def claims() -> str:
    """What the paper says of rates, at the look of this many seeds."""
    found = study(STUDY)
    verdicts = [each for each in found.verdicts if each.verdict != "not run"]
    [look] = {each.evidence.look for each in verdicts if each.evidence}
    supported = [each for each in verdicts if each.verdict == "supported"]
    better = {each.claim.better for each in supported}
    expect(
        {each.verdict for each in verdicts} == {"supported", "undecided"}
        and {each.claim.worse for each in supported} == {"fdc"}
        and better == set(_RATES) - {"md-0.1"},
        "that the rates of 0.2 to 0.5 beat FDC, and nothing else",
    )
    means = {variant: found.after(variant).mean for variant in _LABELS}
    expect(max(means, key=lambda each: means[each]) == "md-0.2", "that 0.2 is the best rate")
    seeds, rule = found.arm("dcc").done, found.registration
    best = found.verdict("md-0.2", "dcc")
    faster = found.verdict("md-0.3", "dcc", measure="learning")
    names = listing([rate.removeprefix("md-") for rate in sorted(better)])
    return paragraph(
        f"""Of the paper's {number(len(verdicts))} orderings of rates (l. 418-421 and 456-460)
        {number(len(supported))} are **supported** at the {ordinal(look)} registered look, with
        {number(len(seeds))} seeds: after training the rates {names} catch more than FDC. All others
        are **undecided**, next look at {rule.looks[look]} seeds: that a good rate beats simple DCC
        (0.2 does by {difference(best).text(1)}), that catches rise from 0 to the best rate, and
        that learning gets faster with the rate (0.3 against DCC: {difference(faster).text(1)} over
        the whole training). The means are highest at 0.2, where the paper has its best rates."""
    )


def paper() -> str:
    """How many of all orderings of rates are supported, for a cell of PAPER.md."""
    found = study(STUDY)
    verdicts = [each for each in found.verdicts if each.verdict != "not run"]
    seeds = number(len(found.arm("dcc").done))
    words = f"of all {number(len(verdicts))} orderings of rates {counted(verdicts)}"
    return f"{seeds} seeds at N = 6: `{STUDY}`, {words}"


BLOCKS: dict[str, Callable[[], str]] = {
    "rates-catches": catches,
    "rates-claims": claims,
    "paper-rates": paper,
}
