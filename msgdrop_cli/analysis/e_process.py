"""Evidence that holds whenever somebody stops: the symmetric e-process, and what it leaves over.

If nothing is true of a claim, the sign of each seed's difference d is a fair coin, whatever its
size and the seeds before. So for any bet b that sizes and earlier seeds fix, exp(b d) / cosh(b d)
has mean 1: a gamble at fair odds. Its product over the seeds is a martingale that begins at 1, and
so is the mean of several; by Ville's inequality it ever reaches 1 / alpha in at most alpha of all
studies.

The bets are BETS over the root mean square of the differences so far, so that units do not matter.
Source: V. de la Pena, Ann. Probab. 27 (1999), for symmetric sums; V. Vovk and R. Wang,
Nonparametric e-tests of symmetry, arXiv 2208.08925. As cosh(x) <= exp(x^2 / 2), it is never below
their Fisher-type exp(b d - b^2 d^2 / 2) of the same bets.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from msgdrop_cli.analysis.statistics import Interval, mean

BETS = (0.5, 1.0, 2.0, 4.0, 8.0)
"""In root mean squares of the differences (ours): from effects that some twenty seeds can show to
nearly the sign test, of which six seeds that agree are worth 22."""
_PLACES = 2_048
"""Means that are tried on each side."""
_AT_ONCE = 64
"""Of them, from the outermost on: one that is left ends the search."""


class Anytime(NamedTuple):
    """What seeds 1 to n say of one claim alone, whoever stopped there and why."""

    seeds: int
    e: float
    """The gambler's wealth now, 1 at the start; ever 1 / alpha in at most alpha of all studies."""
    p: float
    """One over the most that it has been; 1 at most."""
    interval: Interval | None
    """95%: the means of which a gambler's wealth is below 20 now; None if they might be any."""

    def to_json(self) -> dict[str, float | None]:
        """The same, flat and ready for JSON."""
        low, high = self.interval or (None, None)
        return {"seeds": self.seeds, "e": self.e, "p": self.p, "low": low, "high": high}


def anytime(differences: Sequence[float], sides: int, alpha: float = 0.05) -> Anytime | None:
    """The evidence of these differences in the order of their seeds; None without any."""
    if not differences:
        return None
    wealth = e_process(differences, sides)
    return Anytime(
        seeds=len(differences),
        e=wealth[-1],
        p=min(1.0, 1.0 / max(wealth)),
        interval=mean_at_any_stop(differences, alpha),
    )


def e_process(differences: Sequence[float], sides: int) -> list[float]:
    """The wealth after each seed; one side bets on differences above 0, two on both alike."""
    import numpy as np

    wealth: list[float] = _wealth(np.asarray([differences], dtype=np.float64), sides)[0].tolist()
    return wealth


def mean_at_any_stop(values: Sequence[float], alpha: float) -> Interval | None:
    """The smallest interval that holds each mean whose two-sided wealth is below 1 / alpha.

    Of the sequence of these intervals at most alpha of all studies ever leave out the true centre.
    None where no mean, however far, is left out: below six values at 5%.
    """
    import numpy as np

    table = np.asarray(values, dtype=np.float64)
    centre, size = mean(values), float(np.ptp(table))
    farthest = _wealth(np.ones((1, len(table))), 2)[0, -1]  # all values on one side, far away
    if farthest < 1.0 / alpha:
        return None
    if size <= 0.0:
        return Interval(centre, centre)
    ends = [_end(table, centre, direction * size, 1.0 / alpha) for direction in (-1.0, 1.0)]
    return Interval(*ends)


def _end(table: Any, centre: float, step: float, enough: float) -> float:
    """The outermost mean on one side of the centre whose wealth is not enough."""
    import numpy as np

    def is_left(means: Any) -> Any:
        return _wealth(table - np.asarray(means)[:, None], 2)[:, -1] < enough

    while is_left([centre + step])[0] and math.isfinite(centre + step):
        step *= 2.0
    means = np.linspace(centre, centre + step, _PLACES)
    places = np.flatnonzero(_may_be_left(table, means, enough))[::-1]  # the outermost first
    last = 0
    for start in range(0, len(places), _AT_ONCE):
        some = places[start : start + _AT_ONCE]
        left = some[is_left(means[some])]
        if left.size:
            last = int(left[0])
            break
    inner, outer = float(means[last]), float(means[min(last + 1, _PLACES - 1)])
    for _ in range(50):
        middle = (inner + outer) / 2.0
        inner, outer = (middle, outer) if is_left([middle])[0] else (inner, middle)
    return inner


def _may_be_left(table: Any, means: Any, enough: float) -> Any:
    """Which means the Fisher-type bets do not rule out: they win no more, and cost no logarithm.

    One that alone has enough for all, and a little more, for what is lost in adding, rules out.
    """
    import numpy as np

    ratio = _over_scale(table - means[:, None])
    first, second = (each.cumsum(axis=1)[:, -1] for each in (ratio, np.square(ratio)))
    bets = np.array([*BETS, *(-bet for bet in BETS)])[:, None]
    won = (bets * first - np.square(bets) * second / 2.0).max(axis=0)
    return won < math.log(enough * len(bets)) + 1e-6


def _over_scale(table: Any) -> Any:
    """Each value over the root mean square of those so far; table: [studies, seeds]."""
    import numpy as np

    counts = np.arange(1.0, table.shape[1] + 1.0)
    scale = np.sqrt(np.square(table).cumsum(axis=1) / counts)
    return np.divide(table, scale, out=np.zeros_like(table), where=scale > 0.0)


def _wealth(table: Any, sides: int) -> Any:
    """After each seed; table: [studies, seeds], returns the same."""
    import numpy as np

    ratio = _over_scale(table)
    bets = np.array(BETS if sides == 1 else [*BETS, *(-bet for bet in BETS)])[:, None, None]
    # exp(x) / cosh(x) is 2 / (1 + exp(-2 x)), which does not overflow in logarithms.
    gains = math.log(2.0) - np.logaddexp(0.0, -2.0 * bets * ratio)  # [bets, studies, seeds]
    return np.exp(gains.cumsum(axis=2)).cumsum(axis=0)[-1] / len(bets)
