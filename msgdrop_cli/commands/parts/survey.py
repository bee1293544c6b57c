"""What the store has of a plan: which runs are done, which go on, and how much is left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.records.store import RUNS, RunRecord, find_run


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """The distinct runs of a plan and what the store has of them."""

    runs: tuple[PlannedRun, ...]
    """Each run id once."""
    records: Mapping[str, RunRecord]
    """By run id."""

    @property
    def pending(self) -> tuple[PlannedRun, ...]:
        """The runs to be trained: neither finished nor diverged, which they would do again."""
        return tuple(run for run in self.runs if self.status(run) not in ("done", "diverged"))

    @property
    def resumable(self) -> tuple[PlannedRun, ...]:
        """Those pending that have been trained for a while."""
        return tuple(run for run in self.pending if self.env_steps(run))

    def env_steps(self, run: PlannedRun) -> int:
        """Env steps that the run has behind it."""
        return self.records[run.run_id].env_steps if run.run_id in self.records else 0

    def env_steps_left(self, run: PlannedRun) -> int:
        """Env steps that the run has before it."""
        return max(0, run.spec.training.train_env_steps - self.env_steps(run))

    def status(self, run: PlannedRun) -> str:
        """The status word of the run's record; planned without one."""
        return self.records[run.run_id].status if run.run_id in self.records else "planned"


def survey(runs: Sequence[PlannedRun], root: Path) -> Survey:
    """Look up every run of a plan in the results folder; RecordError for a damaged record."""
    distinct: dict[str, PlannedRun] = {}
    for run in runs:
        distinct.setdefault(run.run_id, run)
    found = {run_id: find_run(root / RUNS, run_id) for run_id in distinct}
    return Survey(
        runs=tuple(distinct.values()),
        records={run_id: record for run_id, record in found.items() if record is not None},
    )
