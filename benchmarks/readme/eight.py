"""What came out on pursuit with eight agents when links break: figure 6."""

from collections.abc import Callable

from benchmarks.readme.judged import BROKEN, LABELS, counted, told_by_channel
from benchmarks.readme.studies import (
    ALL,
    EIGHT,
    HALF,
    NONE,
    difference,
    expect,
    number,
    paragraph,
    study,
    table,
)

_ARMS = ("fdc", "dcc", "md-0.2", "md-0.5")


def catches() -> str:
    """Catches of every arm with none, half and all of the links broken."""
    found = study(BROKEN, EIGHT)
    rows = (
        (LABELS[arm], *(found.after(arm, channel).text(1) for channel in (NONE, HALF, ALL)))
        for arm in _ARMS
    )
    return table(("variant", "none of the links broken", "half", "all"), rows)


def claims() -> str:
    """Every claim, a line a word."""
    return "\n".join(told_by_channel(study(BROKEN, EIGHT)))


def front() -> str:
    """The same in a sentence, for the front page."""
    found = study(BROKEN, EIGHT)
    [other] = [each for each in found.verdicts if each.verdict != "supported"]
    expect(
        (other.claim.better, other.claim.worse, other.claim.channel) == ("md-0.5", "dcc", HALF)
        and other.verdict == "undecided",
        "which claim about eight agents is not supported",
    )
    count, seeds = len(found.verdicts), number(len(found.arm("dcc").done))
    return paragraph(
        f"""With eight agents {number(count - 1)} of the {number(count)} are **supported**, in
        {seeds} seeds; that with half of the links broken DCC-MD 0.5 beats simple DCC, by
        {difference(other).text(1)} catches, is **undecided**
        ([table](results/README.md#with-eight-agents))."""
    )


def paper() -> str:
    """How many are supported, for a cell of PAPER.md."""
    found = study(BROKEN, EIGHT)
    agree = sum((each.difference or 0.0) > 0.0 for each in found.verdicts)
    seeds = number(len(found.arm("dcc").done))
    count = f"{number(agree)} of {number(len(found.verdicts))} go the paper's way"
    return f"{seeds} at N = 8: {count}, {counted(found.verdicts)}"


def paper_without_dropout() -> str:
    """What is on record of simple DCC against FDC, which no verdict is about yet."""
    found = study(BROKEN, EIGHT)
    dcc, fdc = (found.after(arm, NONE) for arm in ("dcc", "fdc"))
    expect(dcc.mean > fdc.mean, "that eight agents catch more with messages than without")
    seeds = number(len(found.arm("dcc").done))
    return (
        f"no verdict, since the rates 0.1, 0.3 and 0.4 are not trained at N = 8; {seeds} seeds of"
        f" both point the other way: {dcc.text(1)} catches against {fdc.text(1)} (`{BROKEN}`)"
    )


BLOCKS: dict[str, Callable[[], str]] = {
    "eight-front": front,
    "eight-catches": catches,
    "eight-claims": claims,
    "paper-eight": paper,
    "paper-without-dropout": paper_without_dropout,
}
