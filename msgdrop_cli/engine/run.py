"""Runs from beginning to end: fresh or resumed, logged, checkpointed, and finished exactly once.

What a run gives depends on its spec and seed only: not on the cohort it is stacked in, on a crash
and resume, or on whether somebody watches (tests/test_independence.py).
"""

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, replace
from itertools import groupby
from pathlib import Path
from typing import Any

from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine import arithmetic
from msgdrop_cli.engine.checkpoint import restore
from msgdrop_cli.engine.divergence import not_finite
from msgdrop_cli.engine.facts import facts, kernel_name
from msgdrop_cli.engine.graphs import Chunks, recorder
from msgdrop_cli.engine.opening import Run, lock, open_run
from msgdrop_cli.engine.pretraining import pretrained
from msgdrop_cli.engine.tensors import write_tensors
from msgdrop_cli.engine.training import Training
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import (
    Epoch,
    append_jsonl,
    cut_jsonl,
    remove_file,
    sync_file,
    write_json_atomic,
)
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.run_file import Status
from msgdrop_cli.records.store import (
    METRICS,
    POLICY,
    PROGRESS,
    find_run,
)

NOT_EXACT = "not bit-exact: it was resumed, and its game does not repeat itself from its seed"
_LOOK_UP_EVERY_S = 0.5
_AT_LEAST_EVERY_S = 60.0
"""On a CPU, so that a kill costs a minute, whatever the interval in env steps; on a GPU a cohort's
replay memory is gigabytes."""
_QUICK_S, _PUT_OFF = 0.15, 60
"""A checkpoint that takes longer is a sixtieth of the time until the next one, at most; a quicker
one is 2% of the shortest default interval, 7 s (benchmarks/NOTES.md)."""


@arithmetic.settled()
def train_cohort(
    runs: Sequence[PlannedRun],
    root: Path,
    *,
    device: str = "cpu",
    stop: Callable[[], bool] = lambda: False,
) -> list[Outcome]:
    """Train runs that share every shape, stacked; finished ones are left as they are.

    `stop` is asked about twice a second; if it says so, checkpoints are written and the outcomes
    are `interrupted`. Any other fault makes the runs `failed`, with the reason.
    Raises RecordError if another process trains one of them (75), RunError if one was begun with
    another kernel or another version.
    """
    outcomes = []
    with ExitStack() as locks:
        pending = []
        for planned in runs:
            found = lock(planned, root, locks)
            if isinstance(found, Epoch):
                pending.append(open_run(planned, found, device))
            else:
                outcomes.append(_outcome(planned, found.path, "done", None))
        pending.sort(key=lambda run: run.env_steps)
        for _, group in groupby(pending, key=lambda run: run.env_steps):
            outcomes += _train_group(list(group), root, device, stop)
    return outcomes


def _train_group(
    runs: list[Run], root: Path, device: str, stop: Callable[[], bool]
) -> list[Outcome]:
    try:
        training = Training([run.planned.spec for run in runs], device)
        encoder = pretrained(runs[0].planned.spec, training.learner.encoding, root, stop)
        if encoder is None:
            reason = "stopped while its encoder learnt"
            for run in runs:
                run.write_down("interrupted", reason)
            return [_outcome(run.planned, run.path, "interrupted", reason) for run in runs]
        training.begin(encoder.weights)
        known = {"pretraining": asdict(encoder.facts)} if encoder.facts else {}
        return _Session(runs, training, device, known).train(stop)
    except Exception as error:  # whatever it was, it is written down, and the other cohorts go on
        reason = f"{type(error).__name__}: {error}"
        code = error.exit_code if isinstance(error, RecordError) and error.exit_code > 64 else 3
        for run in runs:
            with suppress(RecordError):  # a full disk may refuse this, too
                run.write_down("failed", reason)
        outcomes = [_outcome(run.planned, run.path, "failed", reason) for run in runs]
        return [replace(outcome, exit_code=code) for outcome in outcomes]


class _Session:
    """A cohort between its start (or resume) and its end (or stop)."""

    def __init__(
        self, runs: list[Run], training: Training, device: str, known: Mapping[str, Any]
    ) -> None:
        """training: begun; known: facts for the records beside the usual ones."""
        self.runs = runs
        self.plan = runs[0].planned.spec.training
        self.on_cpu = device == "cpu"
        self.training = training
        self.kernel = kernel_name(runs[0].planned.spec, device)
        self.chunks = Chunks(self.training, recorder(device))
        self.logged_at = 0
        known = {**known, **facts(training.env, self.kernel, device)}  # asks git: once for all
        for number, run in enumerate(runs):
            if run.checkpoint is not None:
                if not restore(self.training, number, run.checkpoint):
                    run.note = f"{run.note}; {NOT_EXACT}" if run.note else NOT_EXACT
                run.rows = run.checkpoint.counters.rows
                self.logged_at = run.checkpoint.counters.logged_at
            run.checkpoint = None  # its replay memory has been copied
            run.write_down("running", **known)
            cut_jsonl(run.path / METRICS, run.rows)
        self.clock = self.kept_at = self.put_off_until = time.monotonic()
        self.cpu_clock = time.process_time()
        self.steps_at_start = self.training.env_steps
        self.headline: list[float | None] = [None] * len(runs)

    def train(self, stop: Callable[[], bool]) -> list[Outcome]:
        """Train until the end, or until `stop` says so."""
        training, plan = self.training, self.plan
        looked_up = self.clock
        while training.env_steps < plan.train_env_steps:
            before = training.env_steps
            self.chunks.advance(self._steps_to_write())
            for number, updates in training.odd.items():
                if not self.runs[number].diverged:
                    self._diverge(number, not_finite(training, number) or "loss", updates)
            if self._passes(before, plan.log_every_env_steps):
                self._log()
            if all(run.diverged for run in self.runs):
                break
            if training.env_steps >= plan.train_env_steps:
                break  # a checkpoint would be deleted at once
            if self._passes(before, plan.checkpoint_every_env_steps):
                self._checkpoint_unless_put_off()
            if time.monotonic() - looked_up >= _LOOK_UP_EVERY_S:
                looked_up = time.monotonic()
                self._show_progress()
                if stop():
                    self._checkpoint()
                    return self._close("interrupted")
                if self.on_cpu and looked_up >= self.kept_at + _AT_LEAST_EVERY_S:
                    self._checkpoint_unless_put_off()
        return self._finish()

    def _steps_to_write(self) -> int:
        """Steps until there is something to log or to keep."""
        plan, now = self.plan, self.training.env_steps
        each = (plan.log_every_env_steps, plan.checkpoint_every_env_steps)
        next_stop = min(plan.train_env_steps, *((now // every + 1) * every for every in each))
        return -(-(next_stop - now) // plan.games)

    def _passes(self, before: int, every: int) -> bool:
        return before // every != self.training.env_steps // every

    def _log(self) -> None:
        """One row of metrics.jsonl for each run: the window since the last row."""
        training = self.training
        metrics = training.window(training.env_steps - self.logged_at)
        learned = training.learner.metrics(training.env_steps)
        self.logged_at = training.env_steps
        for number, run in enumerate(self.runs):
            if run.diverged:
                continue
            row = {**learned[number], **metrics[number]}
            odd = [name for name, value in row.items() if not math.isfinite(value or 0.0)]
            if where := not_finite(training, number) or (odd and odd[0]):
                self._diverge(number, where, training.learner.progress[0])
                continue
            head = {"env_steps": training.env_steps}
            tail = {"wall_time_s": round(self._wall_time(run), 3)}
            run.epoch.check()
            append_jsonl(run.path / METRICS, {**head, **row, **tail}, durable=False)
            run.rows += 1
            self.headline[number] = metrics[number][next(iter(training.env.metrics))]

    def _diverge(self, number: int, what: str, updates: int) -> None:
        """A run ends here, and is never gone on with; the others of its cohort go on."""
        run, at = self.runs[number], f"{self.training.env_steps} env steps, after {updates} updates"
        run.diverged = f"{what} is not finite at {at}"
        sync_file(run.path / METRICS)
        run.write_down("diverged", run.diverged, **self._progress_facts(run))

    def _checkpoint_unless_put_off(self) -> None:
        if time.monotonic() >= self.put_off_until:
            self._checkpoint()

    def _checkpoint(self) -> None:
        began = time.monotonic()
        for number, run in self._sound():
            if not_finite(self.training, number):
                continue  # the last good one stays; this run ends at its next update
            sync_file(run.path / METRICS)  # a checkpoint counts on its rows
            run.checkpoints.save(
                self.training,
                number,
                rows=run.rows,
                logged_at=self.logged_at,
                kernel=self.kernel,
            )
            run.write_down("running", **self._progress_facts(run))
        self.kept_at = time.monotonic()
        took = self.kept_at - began
        self.put_off_until = self.kept_at + (_PUT_OFF * took if took > _QUICK_S else 0.0)

    def _finish(self) -> list[Outcome]:
        if self.logged_at < self.training.env_steps:
            self._log()
        for number, run in self._sound():
            run.epoch.check()
            write_tensors(run.path / POLICY, self.training.learner.policy(number))
        outcomes = self._close("done")
        for _, run in self._sound():
            run.checkpoints.remove()
        return outcomes

    def _close(self, status: Status) -> list[Outcome]:
        outcomes = []
        for run in self.runs:
            if not run.diverged:
                sync_file(run.path / METRICS)
                run.write_down(status, run.note, **self._progress_facts(run))
            word: Status = "diverged" if run.diverged else status
            outcomes.append(_outcome(run.planned, run.path, word, run.diverged or run.note))
            remove_file(run.path / PROGRESS)
        return outcomes

    def _sound(self) -> Iterable[tuple[int, Run]]:
        return ((number, run) for number, run in enumerate(self.runs) if not run.diverged)

    def _wall_time(self, run: Run) -> float:
        return run.wall_time_s + time.monotonic() - self.clock

    def _progress_facts(self, run: Run) -> dict[str, Any]:
        facts = {
            "env_steps": self.training.env_steps,
            "wall_time_s": round(self._wall_time(run), 3),
        }
        if run.cpu_time_s is not None:
            spent = time.process_time() - self.cpu_clock
            facts["cpu_time_s"] = round(run.cpu_time_s + spent, 3)
        return facts

    def _show_progress(self) -> None:
        """For people only: nothing is decided by what stands here."""
        training, total = self.training, self.plan.train_env_steps
        spent = max(time.monotonic() - self.clock, 1e-9)
        speed = (training.env_steps - self.steps_at_start) / spent
        for number, run in self._sound():
            progress = {
                "phase": "training",
                "env_steps": training.env_steps,
                "train_env_steps": total,
                "env_steps_per_s": round(speed, 1),
                "eta_s": round((total - training.env_steps) / max(speed, 1e-9)),
                "headline": next(iter(training.env.metrics)),
                "headline_value": self.headline[number],
            }
            write_json_atomic(run.path / PROGRESS, progress, durable=False)


def _outcome(planned: PlannedRun, path: Path, status: Status, reason: str | None) -> Outcome:
    record = find_run(path, planned.run_id)
    if record is None:
        raise RecordError(f"{path}: the record has gone")
    return Outcome(
        run_id=planned.run_id,
        path=path,
        status=status,
        reason=reason,
        env_steps=record.env_steps,
        wall_time_s=float(record.run["wall_time_s"]),
        exit_code=3 if status in ("failed", "diverged") else 0,
    )
