"""What came out on the network: features of the own observation and of messages apart, or not."""

from collections.abc import Callable

from benchmarks.readme.judged import NETWORK
from benchmarks.readme.studies import SIX, difference, number, paragraph, study, while_and_after

_LABELS = {
    "dcc": "DCC f/g/h",
    "md-0.2": "DCC-MD 0.2 f/g/h",
    "concat-md-0.2": "DCC-MD 0.2 concat",
}


def catches() -> str:
    """Each arm while it learns, and after."""
    return while_and_after(study(NETWORK, SIX), _LABELS)


def claims() -> str:
    """The claim about six agents."""
    apart = study(NETWORK, SIX).verdict("md-0.2", "concat-md-0.2", measure="learning")
    return paragraph(
        f"""That the network which keeps the own observation apart learns better, with
        message-dropout and six agents (l. 514-516, ours for N = 6), is **{apart.verdict}**: by
        {difference(apart).text(1)} catches over the whole training."""
    )


def paper() -> str:
    """The verdict, for a cell of PAPER.md."""
    found = study(NETWORK, SIX)
    word = found.verdict("md-0.2", "concat-md-0.2", measure="learning").verdict
    return f"{number(len(found.arm('concat-md-0.2').done))} seeds at N = 6: `{NETWORK}`, {word}"


BLOCKS: dict[str, Callable[[], str]] = {
    "network-catches": catches,
    "network-claims": claims,
    "paper-network": paper,
}
