"""Watches runs at work by the files that they write, and shows them; nothing is decided here.

A thread does it, so that it is the same whether the work is done in this process or in others.
"""

import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from msgdrop_cli.commands.parts.console import Progress
from msgdrop_cli.commands.parts.words import duration, several
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import read_json
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.store import PROGRESS
from msgdrop_cli.stopping import WRITING, Control

_HEADERS = ("run", "env steps", "done", "env steps/s", "now", "left")
_TICK_S = 0.05
"""A tenth of a second after Ctrl-C its words are there."""
_TICKS = 20
"""Ticks between two looks at the files."""
_TRAINS = ("training", WRITING)
_STOPPING = "stopping: writing checkpoints (Ctrl-C again to stop without)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """A run to be shown."""

    run_id: str
    name: str
    """What people call it, by `run_name`."""
    path: Path
    train_env_steps: int
    env_steps: int
    """Where it stands at the start."""


def run_name(environment: str, label: str, seed: int) -> str:
    """`pursuit-n6, DCC-MD 0.2, seed 1`: what every line about a run at work begins with."""
    return f"{environment}, {label}, seed {seed}"


class Watch:
    """A context in which the runs' progress is shown, and the outcomes as they arrive."""

    def __init__(self, runs: Sequence[Watched], control: Control) -> None:
        self.runs = {run.run_id: run for run in runs}
        self.control = control
        self.steps = {run.run_id: run.env_steps for run in runs}
        self.begun = set[str]()
        self.ended = set[str]()
        self.display = Progress()
        self.thread = threading.Thread(target=self._watch, daemon=True)
        self.over = threading.Event()

    def __enter__(self) -> "Watch":
        self.display.__enter__()
        self.thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self.over.set()
        self.thread.join()
        self.display.__exit__(kind, error, _)

    def finished(self, outcome: Outcome) -> None:
        """Say how a run ended."""
        self.ended.add(outcome.run_id)
        run = self.runs.get(outcome.run_id)
        if run is None or (outcome.status == "interrupted" and run.run_id not in self.begun):
            return
        self.steps[run.run_id] = max(outcome.env_steps, self.steps[run.run_id])
        facts = [f"{outcome.env_steps:,} env steps"] if outcome.env_steps else []
        facts += [duration(outcome.wall_time_s)] if outcome.wall_time_s else []
        facts += [one_line(outcome.reason)] if outcome.reason else []
        word = "evaluated" if outcome.status == "done" and not facts[1:] else outcome.status
        self.display.say(f"{word:<11}  {run.name}  ({'; '.join(facts)})")

    def _watch(self) -> None:
        told, tick = False, 0
        while not self.over.wait(_TICK_S):
            if self.control.signal is not None and not told:
                told = True
                self.display.say(_STOPPING)
            if tick % _TICKS == 0:
                self._look()
            tick += 1

    def _look(self) -> None:
        rows, speed = [], 0.0
        phases = self.control.phases()
        for run in self.runs.values():
            phase = phases.get(run.run_id)
            if phase is None or run.run_id in self.ended:
                continue
            if run.run_id not in self.begun:
                self.begun.add(run.run_id)
                if not self.display.live:
                    self.display.say(f"{phase.partition(' ')[0]:<11}  {run.name}")
            now = progress(run.path) if phase in _TRAINS else {}
            speed += float(now.get("env_steps_per_s") or 0.0)
            self.steps[run.run_id] = int(now.get("env_steps") or self.steps[run.run_id])
            rows.append(_cells(run, phase, now))
        total = self._total(speed)
        self.display.update(_HEADERS, rows, total, time.monotonic())

    def _total(self, speed: float) -> str:
        steps = sum(self.steps.values())
        asked = sum(run.train_env_steps for run in self.runs.values())
        parts = [f"{len(self.ended)} of {several(len(self.runs), 'run')} done"]
        if steps < asked:
            parts.append(f"{steps:,} of {asked:,} env steps")
        if speed:
            parts.append(f"{speed:,.0f}/s, {duration((asked - steps) / speed)} left")
        return "; ".join(parts)


def progress(path: Path) -> dict[str, Any]:
    """What a run last said of itself; empty if it has not, or not in words that we know."""
    with suppress(RecordError, ValueError, TypeError):
        said = read_json(path / PROGRESS)
        numbers = ("env_steps", "env_steps_per_s", "eta_s")
        if isinstance(said, dict) and all(isinstance(said.get(n), int | float) for n in numbers):
            return said
    return {}


def _cells(run: Watched, phase: str, now: dict[str, Any]) -> tuple[str, ...]:
    if phase not in _TRAINS:
        return (run.name, f"{run.train_env_steps:,}", "100%", "", phase, "")
    if not now:
        return (run.name, f"{run.env_steps:,}", "", "", "starting", "")
    steps, value = int(now["env_steps"]), now.get("headline_value")
    metric = str(now.get("headline") or "").replace("_", " ")
    return (
        run.name,
        f"{steps:,}",
        f"{steps / run.train_env_steps:.0%}",
        f"{now['env_steps_per_s']:,.0f}",
        f"{value:.2f} {metric}" if isinstance(value, int | float) else "",
        duration(float(now["eta_s"])),
    )
