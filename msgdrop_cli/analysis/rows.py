"""One row of numbers: a metric of an arm through a channel, with its estimates over seeds."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from statistics import stdev

from msgdrop_cli.analysis.intervals import mean_interval
from msgdrop_cli.analysis.statistics import Interval, interquartile_mean, iqm_interval, mean
from msgdrop_cli.definition.channel import Channel


@dataclass(frozen=True, kw_only=True)
class Row:
    """One metric of one arm, evaluated through one channel; of many seeds few estimates are asked.

    So each is made when it is asked for, and once.
    """

    metric: str
    channel: Channel
    by_seed: Mapping[int, float]
    """Value of each seed, in order of the seeds."""
    within: float | None
    """Error within a seed: the standard error over its episodes, root mean square of the seeds."""
    episodes: int
    """Evaluation episodes of each seed: as many as of every other row of its group."""
    recorded: int
    """The most that a seed has in its record; the first `episodes` of them count."""
    bootstrap_seed: int

    @cached_property
    def mean(self) -> float:
        """The mean over seeds."""
        return mean([*self.by_seed.values()])

    @cached_property
    def iqm(self) -> float:
        """Interquartile mean over seeds."""
        return interquartile_mean([*self.by_seed.values()])

    @cached_property
    def interval(self) -> Interval | None:
        """95% sign-flip interval of the mean; below six seeds lowest to highest, None for one."""
        return mean_interval([*self.by_seed.values()])

    @cached_property
    def iqm_interval(self) -> Interval | None:
        """95% bootstrap interval of the interquartile mean; None below ten seeds."""
        import numpy as np

        # A generator of its own for each row: an interval must not depend on its neighbours.
        rng = np.random.default_rng(self.bootstrap_seed)
        return iqm_interval([*self.by_seed.values()], rng)

    @cached_property
    def between(self) -> float | None:
        """Standard deviation of the seeds' values, `within` included; None for one seed."""
        return stdev(self.by_seed.values()) if len(self.by_seed) > 1 else None
