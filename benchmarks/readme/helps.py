"""What docs/does-it-help.md and PAPER.md say of verdicts, claim by claim and counted."""

from collections.abc import Callable, Iterable

from benchmarks.readme.judged import (
    BROKEN,
    ELEMENTS,
    NAVIGATION,
    beats,
    counted,
    told,
    told_by_channel,
    told_by_measure,
)
from benchmarks.readme.rates import STUDY as RATES
from benchmarks.readme.readings import HUBER, TARGET, with_huber, with_target
from benchmarks.readme.studies import (
    ALL,
    EIGHT,
    HALF,
    SIX,
    expect,
    number,
    paragraph,
    study,
)

_LISTENERS = ("md-0.2", "md-0.5")


def broken() -> str:
    """Links that break after training, and what of that is decided."""
    known = {game: study(BROKEN, game) for game in (SIX, EIGHT)}
    lines = [*told_by_channel(known[SIX]), *told_by_channel(known[EIGHT], "N = 8, ")]
    words = {
        (game, channel): [found.verdict(each, "dcc", channel).verdict for each in _LISTENERS]
        for game, found in known.items()
        for channel in (HALF, ALL)
    }
    expect(
        words
        == {
            (SIX, HALF): ["undecided", "undecided"],
            (EIGHT, HALF): ["supported", "undecided"],
            **{(game, ALL): ["supported", "supported"] for game in (SIX, EIGHT)},
        },
        "where it is decided that DCC-MD beats DCC",
    )
    said = """That it is better to have dropped messages than not to (DCC) is decided where all
    links break, and where half of them do for a rate of 0.2 with eight agents. Where messages
    mostly do not arrive, train without any as well (FDC), and compare."""
    return _page(lines, said)


def learning() -> str:
    """Pursuit with all messages: who learns faster, and what is decided of rates."""
    found, rates = study(ELEMENTS), study(RATES)
    faster = [found.verdict(each, "dcc", measure="learning") for each in ("md-0.2", "sd-0.2")]
    supported = {
        (each.claim.better, each.claim.worse)
        for each in rates.verdicts
        if (each.verdict, each.claim.measure) == ("supported", "evaluation")
    }
    expect(
        supported == {(f"md-{rate}", "fdc") for rate in ("0.2", "0.3", "0.4", "0.5")},
        "that the rates of 0.2 to 0.5 beat FDC, and no rate DCC",
    )
    said = """There rates of 0.2 to 0.5 catch more after training than FDC, which is decided; that
    any rate beats DCC is not ([all rates](../results/README.md#publisheddropout-rate-two-million)).
    """
    return _page(told(faster, verb="learns faster than"), said)


def navigation() -> str:
    """Both numbers of agents, in training and after it."""
    found = study(NAVIGATION)
    lines = [
        line
        for agents in (8, 10)
        for line in told_by_measure(found, f"navigation-n{agents}", f"navigation N = {agents}")
    ]
    worse = found.verdict("md-0.5", "dcc", environment="navigation-n10", measure="learning")
    expect(worse.verdict == "contradicted", "that a rate of 0.5 costs something")
    with_huber()
    with_target()
    said = f"""These differences are small against what is left to learn there. A rate of 0.5 can
    cost something: begin with 0.2. With ten agents both rates learn worse than DCC where the loss
    is Huber's ([table](../results/README.md#published{HUBER})), and 0.2 as well as DCC where the
    target network follows every 250 updates
    ([table](../results/README.md#published{TARGET})), so whether 0.2 helps there is
    **under-specified**."""
    return _page(lines, said)


def elements() -> str:
    """Whole messages against elements of them."""
    found = study(ELEMENTS)
    after = found.verdict("md-0.2", "sd-0.2")
    during = found.verdict("md-0.2", "sd-0.2", measure="learning")
    return "\n".join(
        f"* {beats(each)} {when} training: **{each.verdict}**"
        for each, when in ((after, "after"), (during, "in"))
    )


def paper_broken() -> str:
    """How many of the claims about broken links are supported, for a cell of PAPER.md."""
    found = study(BROKEN, SIX)
    agree = all((each.difference or 0.0) > 0.0 for each in found.verdicts)
    expect(agree, "that all claims about broken links go the paper's way")
    seeds = number(len(found.arm("dcc").done))
    return (
        f"{seeds} seeds at N = 6: `{BROKEN}`, all {number(len(found.verdicts))} as the paper says,"
        f" {counted(found.verdicts)}"
    )


def paper_elements() -> str:
    """The same of blocks against elements."""
    found = study(ELEMENTS)
    first = found.verdict("md-0.2", "sd-0.2")
    others = {each.verdict for each in found.verdicts if each is not first}
    expect(len(others) == 1, "that the other claims of the elements have one word")
    seeds = number(len(found.arm("dcc").done))
    return (
        f"{seeds} seeds at N = 6: `{ELEMENTS}`, the first {first.verdict} after training, the"
        f" others {others.pop()}"
    )


def paper_navigation() -> str:
    """The same of navigation."""
    found = study(NAVIGATION)
    during, after = (
        [each for each in found.verdicts if each.claim.measure == measure]
        for measure in ("learning", "evaluation")
    )
    [against] = [each for each in during if each.verdict == "contradicted"]
    [word] = {each.verdict for each in after}
    with_huber()
    with_target()
    game = against.claim.environment.removeprefix("navigation-n")
    rate = against.claim.better.removeprefix("md-")
    few, many = (number(len(found.arm("dcc", f"navigation-n{n}").done)) for n in (8, 10))
    return (
        f"{few} seeds at N = 8, {many} at N = 10: `{NAVIGATION}`, while learning {counted(during)}"
        f" ({rate} against DCC at N = {game}), after it {word}; with Huber's loss both rates"
        f" are contradicted there (`{HUBER}`), with a target network that follows every 250"
        f" updates 0.2 is level with DCC (`{TARGET}`), which makes it under-specified"
    )


def within() -> str:
    """The standard error that a seed's own episodes leave."""
    rows = [
        row
        for arm in study(BROKEN, SIX).summary.arms
        for row in arm.rows
        if row.metric == arm.metrics.headline.name and row.within is not None
    ]
    errors = [row.within for row in rows if row.within is not None]
    [episodes] = {row.episodes for row in rows}
    return paragraph(
        f"{episodes:,} episodes of pursuit leave {min(errors):.1f} to {max(errors):.1f} catches"
    )


def _page(lines: Iterable[str], said: str) -> str:
    return "\n".join([*lines, "", paragraph(said)])


BLOCKS: dict[str, Callable[[], str]] = {
    "help-broken": broken,
    "help-learning": learning,
    "help-navigation": navigation,
    "help-elements": elements,
    "paper-broken": paper_broken,
    "paper-elements": paper_elements,
    "paper-navigation": paper_navigation,
    "error-within": within,
}
