"""What came out on dropping the own observation, too: figure 5a."""

from collections.abc import Callable

from benchmarks.readme.judged import LABELS, NETWORK, counted, of_game, told
from benchmarks.readme.studies import (
    SIX,
    difference,
    expect,
    number,
    paragraph,
    study,
    while_and_after,
)

STUDY = "own-observation-two-million"
_REMARKS = {
    "dcc": " (nothing dropped)",
    "md-0.2": " (messages)",
    "sd-0.2": " (elements of messages)",
    "full-md-0.2": " (messages and the own observation)",
    "full-sd-0.2": " (elements of both)",
}
_MEASURES = {"learning": "in training", "evaluation": "after training"}


def catches() -> str:
    """Each arm while it learns, and after."""
    labels = {variant: LABELS[variant] + remark for variant, remark in _REMARKS.items()}
    return while_and_after(study(STUDY), labels)


def claims() -> str:
    """Every claim of the figure, a line a word."""
    found = study(STUDY)
    lines = [
        line
        for measure, when in _MEASURES.items()
        for line in told(of_game(found, SIX, measure), f"{when}: ")
    ]
    return "\n".join(lines)


def front() -> str:
    """Figures 5a and 5b in two sentences, for the front page."""
    found = study(STUDY)
    slower = found.verdict("dcc", "full-md-0.2", measure="learning")
    worse = found.verdict("dcc", "full-sd-0.2")
    apart = study(NETWORK, SIX).verdict("md-0.2", "concat-md-0.2", measure="learning")
    words = {slower.verdict, worse.verdict, apart.verdict}
    expect(words == {"supported"}, "that Full MD, Full SD and one perceptron do worse")
    seeds, last = number(len(found.arm("full-md-0.2").done)), found.after("full-sd-0.2").text(1)
    return paragraph(
        f"""Dropping the own observation, too, costs what the paper says, in {seeds} seeds: Full MD
        learns more slowly than simple DCC, by {difference(slower).text(1)} catches over the
        training (**{slower.verdict}**), and Full SD hardly learns: {last} catches after training
        (worse than DCC: **{worse.verdict}**; [figure
        5a](results/README.md#publishedown-observation-two-million)). Nor should it be one input
        among others: one perceptron on all inputs learns worse, by {difference(apart).text(1)}
        (**{apart.verdict}**; [figure 5b](results/README.md#publishedarchitecture-two-million))."""
    )


def paper() -> str:
    """How many are supported, for a cell of PAPER.md."""
    found = study(STUDY)
    seeds = number(len(found.arm("full-md-0.2").done))
    words = (f"{when} {counted(of_game(found, SIX, each))}" for each, when in _MEASURES.items())
    return f"{seeds} seeds at N = 6: `{STUDY}`, {'; '.join(words)}"


BLOCKS: dict[str, Callable[[], str]] = {
    "own-catches": catches,
    "own-claims": claims,
    "own-front": front,
    "paper-own": paper,
}
