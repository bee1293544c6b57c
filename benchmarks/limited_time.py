"""A question trained under a limit of time: in which order, until when, and what is carried away.

The scheduler and the engine are those of `msgdrop ablate`. Nothing here guesses how long the end
takes: what the machine needs to write and to pack is measured before the first run begins.
"""

import threading
import time
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Any

import torch

from msgdrop_cli.commands.parts.estimate import check_folder, check_memory
from msgdrop_cli.commands.parts.shapes import Sizes, check_claims, run_sizes
from msgdrop_cli.commands.parts.survey import survey, wanted_of
from msgdrop_cli.definition.cohorts import group
from msgdrop_cli.definition.plan import Plan
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine.facts import commit
from msgdrop_cli.engine.tensors import write_tensors
from msgdrop_cli.records.archive import LARGEST_ARCHIVE, contents, pack
from msgdrop_cli.records.files import write_json_atomic
from msgdrop_cli.records.ours import delete_leftovers
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.scheduler import Task, run_tasks
from msgdrop_cli.stopping import Control, Stopped

STATE = "campaign.json"
_SHARE_OF_GPU = 0.5
"""Of the free memory for what runs keep; the rest is for what a step and its graphs need."""
_SAFETY = 2.0
"""The end is given that many times the seconds that the machine was measured to need for it."""
_NOTICE_S = 2.0
"""Seconds until everybody has noticed that time is up: they look twice a second."""
_PROBE_BYTES = 2**24


@dataclass(frozen=True, slots=True)
class Speeds:
    """What this machine was measured to do at the start, bytes a second."""

    checkpoint: float
    pack: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """One question on one machine until a moment."""

    asked: Plan
    out: Path
    """Runs, archives, state and log."""
    device: str
    workers: int
    seeds_at_once: int
    ends: float
    """By time.monotonic()."""
    control: Control

    def carry_out(self) -> None:
        """Train, evaluate and pack until everything is done or time is up."""
        looked_up = survey(wanted_of(self.asked), self.out)
        delete_leftovers(looked_up.own)
        check_claims(self.asked, looked_up.pending)
        sizes = {
            run.run_id: run_sizes(run, self.asked.evaluation_episodes) for run in looked_up.runs
        }
        batches = self._batches(looked_up.pending, sizes)
        needed = [sum(sizes[run.run_id].memory for c in batch for run in c) for batch in batches]
        check_memory(max(needed, default=0), self.device)
        # Two checkpoints of whoever is interrupted: the old one stays until the new one is whole.
        kept = sum(sizes[run.run_id].kept for run in looked_up.pending)
        check_folder(self.out, kept + 2 * max(needed, default=0))
        speeds = measure(self.out, self.device)
        # First, without training, what an earlier session left to be evaluated and packed.
        left = [run for run in looked_up.runs if run not in looked_up.pending]
        runs_of = [left, *([run for cohort in batch for run in cohort] for batch in batches)]
        for batch, size, runs in zip([(), *batches], [0, *needed], runs_of, strict=True):
            # The last archive is packed again with what came to it.
            packed = LARGEST_ARCHIVE + sum(sizes[run.run_id].kept for run in runs)
            until = self.ends - _NOTICE_S - _SAFETY * packed / speeds.pack
            self._train(batch, until - _SAFETY * size / speeds.checkpoint)
            self._evaluate(until)
            self._pack()
            if self.control.signal is not None:
                raise Stopped(self.control.signal)
            if time.monotonic() >= until:
                return

    def _batches(
        self, pending: Sequence[PlannedRun], sizes: dict[str, Sizes]
    ) -> list[list[tuple[PlannedRun, ...]]]:
        """Cohorts that train at the same time, lowest seeds of all variants first."""
        if not pending:
            return []
        most, together = 1, self.workers
        if self.device == "cuda":
            room = _SHARE_OF_GPU * torch.cuda.mem_get_info()[0]
            most, together = int(room / max(sizes[run.run_id].memory for run in pending)), 1
        seeds = list(dict.fromkeys(run.spec.seed for run in self.asked.runs))
        rank = {seed: number for number, seed in enumerate(seeds)}
        in_order = sorted(pending, key=lambda run: rank[run.spec.seed])
        blocks = groupby(in_order, key=lambda run: rank[run.spec.seed] // self.seeds_at_once)
        cohorts = [c for _, block in blocks for c in group(block, max(1, most))]
        cohorts.sort(key=lambda cohort: rank[cohort[0].spec.seed])
        return [cohorts[i : i + together] for i in range(0, len(cohorts), together)]

    def _train(self, batch: Sequence[tuple[PlannedRun, ...]], until: float) -> None:
        tasks = [
            Task(root=self.out, train=cohort, channels=(), episodes=0, device=self.device)
            for cohort in batch
        ]
        self._work("training", tasks, until)

    def _evaluate(self, until: float) -> None:
        """All channels of every run that is trained and lacks episodes."""
        tasks = [
            Task(
                root=record.path,
                trained=(record,),
                channels=self.asked.channels,
                episodes=self.asked.evaluation_episodes,
                device=self.device,
            )
            for record in self._done()
            if not self._is_evaluated(record)
        ]
        self._work("evaluating", tasks, until)

    def _work(self, phase: str, tasks: list[Task], until: float) -> None:
        if not tasks or self.control.signal is not None or time.monotonic() >= until:
            return
        self.write_state(phase)
        with _stopped_at(self.control, until):
            for outcome in run_tasks(tasks, self.control, workers=self.workers):
                if outcome.reason:
                    say(f"{outcome.run_id}: {outcome.status}: {outcome.reason}")

    def _pack(self) -> None:
        ready = [record for record in self._done() if self._is_evaluated(record)]
        for path in pack(ready, self.out, self._archive_name()):
            say(f"packed {path}")

    def _done(self) -> list[RunRecord]:
        looked_up = survey(wanted_of(self.asked), self.out)
        return [r for r in looked_up.records.values() if r.status == "done"]

    def _is_evaluated(self, record: RunRecord) -> bool:
        return record.has_episodes(self.asked.channels, self.asked.evaluation_episodes)

    def _archive_name(self) -> str:
        return f"{self.asked.definition.name}-{self.asked.profile}"

    def write_state(self, phase: str) -> list[dict[str, Any]]:
        """Rewrite campaign.json, for people and programs that ask; returns what it says of runs."""
        archives = sorted(self.out.glob(f"{self._archive_name()}-[0-9]*.zip"))
        packed = {place: path.name for path in archives for place in contents(path)}
        looked_up = survey(wanted_of(self.asked), self.out)
        runs = []
        for run in looked_up.runs:
            record = looked_up.records.get(run.run_id)
            place = f"{record.environment}/{record.path.name}" if record else ""
            about = {
                "run_id": run.run_id,
                "environment": run.spec.environment,
                "variant": run.variant,
                "seed": run.spec.seed,
                "status": looked_up.status(run),
                "env_steps": looked_up.env_steps(run),
                "train_env_steps": run.spec.training.train_env_steps,
                "archive": packed.get(place),
            }
            runs.append(about)
        left = max(0.0, self.ends - time.monotonic())
        state = {
            "definition": self.asked.definition.name,
            "profile": self.asked.profile,
            "commit": commit(),
            "phase": phase,
            "seconds_left": round(left),
            "written": datetime.now(UTC).isoformat(timespec="seconds"),
            "runs": runs,
        }
        write_json_atomic(self.out / STATE, state)
        say(f"{phase}: {counts(runs)}; {left / 60:.1f} minutes left")
        return runs


def measure(out: Path, device: str) -> Speeds:
    """Bytes a second that go from the device into a safe file, and that are packed."""
    probe = torch.rand(_PROBE_BYTES // 4, device=device)
    file = out / ".tmp-probe"
    try:
        start = time.perf_counter()
        write_tensors(file, {"probe": probe})
        written = time.perf_counter()
        zlib.compress(file.read_bytes())
        packed = time.perf_counter()
    finally:
        file.unlink(missing_ok=True)
    # Twice packed: once to see how much fits into an archive.
    return Speeds(_PROBE_BYTES / (written - start), _PROBE_BYTES / (packed - written) / 2)


@contextmanager
def _stopped_at(control: Control, moment: float) -> Iterator[None]:
    """Asks everybody to stop at `moment`, and takes it back afterwards unless it was a signal."""
    timer = threading.Timer(max(0.0, moment - time.monotonic()), control.ask)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
        if control.signal is None:
            control.ask(False)


def say(line: str) -> None:
    """Show a line at once, also in a log."""
    print(f"{datetime.now(UTC):%H:%M:%S}  {line}", flush=True)


def counts(runs: Sequence[dict[str, Any]]) -> str:
    """The runs of campaign.json in one line."""
    words = [run["status"] for run in runs]
    counts = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
    return f"{len(runs)} runs: {counts}; {sum(run['archive'] is not None for run in runs)} packed"
