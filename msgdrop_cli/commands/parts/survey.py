"""Which runs of a plan are there, which go on, and how much is left: every command asks here.

Own runs count first, then those that others have published in the same results folder, run by run.
What is published is read and nothing else.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.plan import Plan
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.counted import copies_of, preferred
from msgdrop_cli.records.store import ENDED, POLICY, RunRecord, run_path


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """A run, and what it is to be evaluated with."""

    run: PlannedRun
    channels: tuple[Channel, ...]
    episodes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """The distinct runs of a plan and what there is of them."""

    runs: tuple[PlannedRun, ...]
    """Each run id once."""
    records: Mapping[str, RunRecord]
    """By run id."""
    to_play: frozenset[str] = field(default=frozenset())
    """Ids of published runs that lack episodes, and have a policy to play them with."""
    short: frozenset[str] = field(default=frozenset())
    """Ids of runs that are published with neither, and so are to be trained."""

    @property
    def pending(self) -> tuple[PlannedRun, ...]:
        """The runs to be trained: neither finished nor diverged, which they would do again."""
        return tuple(run for run in self.runs if self.status(run) not in ENDED)

    @property
    def resumable(self) -> tuple[PlannedRun, ...]:
        """Those pending that have been trained for a while."""
        return tuple(run for run in self.pending if self.env_steps(run))

    @property
    def own(self) -> tuple[RunRecord, ...]:
        """The records that may be written to."""
        return tuple(record for record in self.records.values() if record.is_own)

    @property
    def published(self) -> tuple[RunRecord, ...]:
        """The records that others have published, which stay as they are."""
        return tuple(record for record in self.records.values() if not record.is_own)

    def env_steps(self, run: PlannedRun) -> int:
        """Env steps that the run has behind it."""
        return self.records[run.run_id].env_steps if run.run_id in self.records else 0

    def env_steps_left(self, run: PlannedRun) -> int:
        """Env steps that the run has before it."""
        return max(0, run.spec.training.train_env_steps - self.env_steps(run))

    def place(self, run: PlannedRun, root: Path) -> Path:
        """Where the run is, or would be trained in the results folder `root`."""
        record = self.records.get(run.run_id)
        return record.path if record else run_path(root, run)

    def status(self, run: PlannedRun) -> str:
        """The status word of the run's record; planned without one."""
        return self.records[run.run_id].status if run.run_id in self.records else "planned"


def wanted_of(asked: Plan, runs: Iterable[PlannedRun] | None = None) -> list[Wanted]:
    """The runs of a plan, or these of them, with its evaluations."""
    return [
        Wanted(run=run, channels=asked.channels, episodes=asked.evaluation_episodes)
        for run in (asked.runs if runs is None else runs)
    ]


def survey(wanted: Iterable[Wanted], root: Path, *, plays: bool = True) -> Survey:
    """Look up every run in the results folder.

    plays: whether a published run whose policy can be played for the episodes that it lacks is
    there. Raises RecordError for a damaged record that would have counted.
    """
    distinct = _once(wanted)
    return _surveyed(distinct, copies_of(root, distinct.keys()), plays=plays)


def survey_among(wanted: Iterable[Wanted], copies: Mapping[str, Sequence[RunRecord]]) -> Survey:
    """The same among records that have been read: by run id, its copies in any order.

    Raises RecordError if the episodes of all published copies of a run are damaged.
    """
    return _surveyed(_once(wanted), copies, plays=True)


def _once(wanted: Iterable[Wanted]) -> dict[str, Wanted]:
    distinct: dict[str, Wanted] = {}
    for each in wanted:
        distinct.setdefault(each.run.run_id, each)
    return distinct


def _surveyed(
    wanted: Mapping[str, Wanted], copies: Mapping[str, Sequence[RunRecord]], *, plays: bool
) -> Survey:
    records: dict[str, RunRecord] = {}
    to_play, short = set[str](), set[str]()
    for run_id, each in wanted.items():
        ordered = preferred(copies.get(run_id, ()), each.run.definition)
        own = next((record for record in ordered if record.is_own), None)
        if ordered and ordered[0] is own:
            records[run_id] = own
            continue
        whole, lacking = _published(ordered, each)
        playable = (record for record in lacking if plays and (record.path / POLICY).is_file())
        if counted := whole or next(playable, None):
            records[run_id] = counted
            if not whole:
                to_play.add(run_id)
        elif own:
            records[run_id] = own
        elif lacking:
            short.add(run_id)
    return Survey(
        runs=tuple(each.run for each in wanted.values()),
        records=records,
        to_play=frozenset(to_play),
        short=frozenset(short),
    )


def _published(
    copies: Sequence[RunRecord], wanted: Wanted
) -> tuple[RunRecord | None, list[RunRecord]]:
    """Of finished published copies the first that has the episodes; else those that lack some.

    Raises RecordError if the episodes of all are damaged.
    """
    lacking, damage = list[RunRecord](), None
    for record in copies:
        if record.is_own or record.status != "done":
            continue
        try:
            if record.has_episodes(wanted.channels, wanted.episodes):
                return record, []
            lacking.append(record)
        except RecordError as error:
            damage = damage or error
    if damage and not lacking:
        raise damage
    return None, lacking
