"""Every claim under the registered rule, and what it was under the rule before."""

from collections.abc import Callable, Iterable

from benchmarks.readme.studies import (
    ALL,
    HALF,
    SIX,
    Study,
    difference,
    expect,
    listing,
    number,
    ordinal,
    paragraph,
    share,
    study,
    table,
)
from msgdrop_cli.analysis.verdict import Verdict
from msgdrop_cli.report.table import NOTHING

BROKEN, ELEMENTS = "broken-links-two-million", "blockwise-vs-elementwise-two-million"
NAVIGATION, NETWORK = "navigation-million-nearest", "architecture-two-million"
"""The studies of ten seeds."""
LABELS = {
    **{"fdc": "FDC", "dcc": "DCC", "md-0.2": "DCC-MD 0.2", "md-0.5": "DCC-MD 0.5"},
    **{"sd-0.2": "DCC-SD 0.2", "full-md-0.2": "Full MD 0.2", "full-sd-0.2": "Full SD 0.2"},
    **{"ddpg": "DDPG", "vanilla-maddpg": "vanilla MADDPG", "maddpg": "MADDPG"},
    **{"maddpg-md-0.2": "MADDPG-MD 0.2", "maddpg-md-0.5": "MADDPG-MD 0.5"},
}
_WORDS = ("supported", "contradicted", "level", "undecided")
"""In the order in which they are told."""
_MEASURES = (("learning", "in"), ("evaluation", "after"))
_SUPPORTED, _OPEN, _NOT_RUN = "supported", "undecided", "not run"
_WAS = (
    *([_SUPPORTED] * 8),  # broken links
    *(_SUPPORTED, *[_OPEN] * 3),  # block-wise against element-wise
    *([_SUPPORTED] * 4),  # navigation in training, N = 8
    *([_NOT_RUN] * 4),  # N = 10
    *(_SUPPORTED, _OPEN, _SUPPORTED, _SUPPORTED),  # navigation after training, N = 8
    *([_NOT_RUN] * 4),  # N = 10
)
"""What the earlier rule said, line by line; with these records it says nothing any more."""


def judged_table() -> str:
    """A line for every claim of the studies of ten seeds."""
    lines = [*_broken(), *_blockwise(), *_navigation()]
    return table(
        ("claim", "difference", "p", "together", "Holm", "now", "was"),
        [(says, *_cells(verdict), was) for (says, verdict), was in zip(lines, _WAS, strict=True)],
    )


def registered() -> str:
    """Looks and alpha of the questions, which are alike, and what was known before."""
    known = [study(name) for name in (BROKEN, ELEMENTS, NAVIGATION)]
    [rule] = {(each.registration.looks, each.registration.alpha_spent) for each in known}
    [seen] = {each.registration.seen for each in known}
    second, third = sorted({v.evidence.look for each in known for v in each.verdicts if v.evidence})
    looks, alphas = rule
    again = {
        (v.claim.environment, v.claim.measure)
        for each in known
        for v in each.verdicts
        if v.evidence and v.evidence.look == third
    }
    expect(
        (second, third, again) == (2, 3, {("navigation-n8", "evaluation")}),
        "which claims have had how many looks",
    )
    both = {each: share(known[0].registration, each) for each in (second, third)}
    alpha = listing([f"{each:g}" for each in alphas])
    return paragraph(
        f"""The verdicts of these studies came from a rule that was too generous: a percentile
        bootstrap interval that excludes 0 with six seeds, which equal arms give in 14% of the
        cases. They are judged now as their questions register it
        ([`docs/verdicts.md`](../docs/verdicts.md)): looks at {listing([*map(str, looks)])} seeds,
        alpha spent {alpha}, both sides. {number(seen).capitalize()} seeds had been looked at before
        that, so they are the first look, and its alpha is gone.
        {number(looks[second - 1]).capitalize()} seeds are the {ordinal(second)} look, which may
        spend {both[second]}: seeds {seen + 1} to {looks[second - 1]}, and all
        {number(looks[second - 1])} of navigation N = 10, were trained before the registration or
        beside it, and looked at by nobody until it stood. Navigation N = 8 has had the
        {ordinal(third)} look since, at {looks[third - 1]} seeds, which may spend {both[third]}: it
        decided nothing more; what the second had decided stays, and its p with it. Each p is of a
        claim alone, then of all claims of its figure (step-down with common flips, Holm);
        differences, of all seeds, with their 95% interval by inverted sign-flips."""
    )


def _broken() -> list[tuple[str, Verdict]]:
    found = study(BROKEN, SIX)
    return [(f"{each.claim.channel.short}: {beats(each)}", each) for each in found.verdicts]


def _blockwise() -> list[tuple[str, Verdict]]:
    found = study(ELEMENTS)
    after = found.verdict("md-0.2", "sd-0.2")
    learning = ("md-0.2", "sd-0.2"), ("md-0.2", "dcc"), ("sd-0.2", "dcc")
    in_training = [found.verdict(*each, measure="learning") for each in learning]
    return [
        (f"{beats(after)} after training", after),
        ("... in training", in_training[0]),
        *((beats(each, "learns faster than"), each) for each in in_training[1:]),
    ]


def _navigation() -> list[tuple[str, Verdict]]:
    found, lines = study(NAVIGATION), []
    for measure, when in _MEASURES:
        for agents in (8, 10):
            verdicts = of_game(found, f"navigation-n{agents}", measure)
            place = f"navigation N = {agents}, {when} training:"
            lines += [
                (f"{'...' if rank else place} {beats(verdict)}", verdict)
                for rank, verdict in enumerate(verdicts)
            ]
    return lines


def beats(verdict: Verdict, word: str = "beats") -> str:
    """Both arms by their labels."""
    return f"{LABELS[verdict.claim.better]} {word} {LABELS[verdict.claim.worse]}"


def told(verdicts: Iterable[Verdict], place: str = "", verb: str = "beats") -> list[str]:
    """A line for each word that claims of one place have."""
    known = [*verdicts]
    return [
        f"* {place}{', '.join(beats(each, verb) for each in alike)}: **{word}**"
        for word in _WORDS
        if (alike := [each for each in known if each.verdict == word])
    ]


def told_by_channel(found: Study, place: str = "") -> list[str]:
    """The same for half and then all of the links broken."""
    return [
        line
        for channel in (HALF, ALL)
        for line in told(
            (each for each in found.verdicts if each.claim.channel == channel),
            f"{place}{channel.short}: ",
        )
    ]


def told_by_measure(found: Study, environment: str, place: str) -> list[str]:
    """The same of one game, in training and after it."""
    return [
        line
        for measure, when in _MEASURES
        for line in told(of_game(found, environment, measure), f"{place}, {when} training: ")
    ]


def counted(verdicts: Iterable[Verdict]) -> str:
    """`seven of eight supported, one contradicted`."""
    words = [each.verdict for each in verdicts]
    counts = [f"{number(words.count(each))} {each}" for each in _WORDS if each in words]
    return listing(counts)


def of_game(found: Study, environment: str, measure: str) -> list[Verdict]:
    """The verdicts on the claims of one game and measure."""
    return [
        each
        for each in found.verdicts
        if (each.claim.environment, each.claim.measure) == (environment, measure)
    ]


def _cells(verdict: Verdict) -> tuple[str, ...]:
    """Difference, the three p, the word."""
    evidence = verdict.evidence
    ps = (evidence.p, evidence.p_family, evidence.p_holm) if evidence else ()
    words = [f"{p:.2g}" for p in ps] or [NOTHING] * 3
    return (difference(verdict).text(2), *words, verdict.verdict)


BLOCKS: dict[str, Callable[[], str]] = {"registered": registered, "judged-again": judged_table}
