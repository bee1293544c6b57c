"""What the runs say about a claim: the word, and every number that led to it. Computes nothing."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from msgdrop_cli.analysis.e_process import Anytime
from msgdrop_cli.analysis.prospects import Prospect
from msgdrop_cli.analysis.statistics import Interval
from msgdrop_cli.analysis.summary import Group
from msgdrop_cli.definition.spec import Claim

Word = Literal[
    "supported",
    "contradicted",
    "level",
    "undecided",
    "estimate",
    "under-specified",
    "not run",
]
"""`under-specified`: registered readings of the paper disagree; `reproduction` says so."""
DECIDED: tuple[Word, ...] = ("supported", "contradicted", "level")
"""Those that a look has given."""


class Evidence(NamedTuple):
    """What one claim's test says at a registered look."""

    look: int
    """Its number: 1, 2, ..."""
    seeds: int
    """Seeds 1 to n are looked at."""
    p: float
    """Of this claim, at this look alone."""
    p_family: float
    """Together with the others: the step-down maximum over common flips."""
    p_holm: float
    """The same by Holm's rule, from the p of each, whatever their dependence."""
    smallest_p: float
    """What p is if all these seeds agree."""
    sampling_error: float
    """Monte-Carlo standard error of p; 0 where all patterns of signs were gone through."""
    alpha_spent: float
    """By this look, all before it included."""
    alpha: float
    """By the last look that is registered."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What the runs say about one claim in one group."""

    claim: Claim
    verdict: Word
    reason: str
    group: Group | None = None
    """None when no group has a run of the claim's variants."""
    difference: float | None = None
    """Mean of `better` minus `worse` over the pairs; turned so that above 0 speaks for it."""
    interval: Interval | None = None
    """95% of this claim alone, whatever the look; lowest to highest below six pairs, None for 1."""
    seeds: int = 0
    """Pairs that `difference` and `interval` are of."""
    lost: int = 0
    """Of these with a run that failed or diverged, and so has the worst value."""
    evidence: Evidence | None = None
    """At the look that decided it, or else the last one; None before the family's first."""
    anytime: Anytime | None = None
    """What holds of seeds 1 to n whoever stopped there; it decides nothing. None without any."""
    prospect: Prospect | None = None
    """What would probably decide it, if it is open."""
    unforeseen: str = ""
    """Why nothing is known that would, if it is open and judged."""
