"""Cohorts on a device: how fast they train, and which kernels that takes (benchmarks/device.py)."""

import time
from dataclasses import dataclass
from typing import Any

import torch

from msgdrop_cli.definition.spec import RunSpec, TrainingSpec
from msgdrop_cli.engine.graphs import STEPS, Chunks, recorder
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.engine.training import Training

WARM_CHUNKS = 45
"""The target is copied every 20 chunks: after 45 both patterns are recorded."""
SECONDS = 4.0


@dataclass(frozen=True, slots=True)
class Cohort:
    """So many runs of an algorithm, of different seeds, at the paper's settings."""

    environment: str
    algorithm: str
    runs: int

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.runs} x {self.environment}"


COHORTS = (
    Cohort("pursuit-n6", "dcc-md", 49),
    Cohort("pursuit-n8", "dcc-md", 49),
    *(Cohort("pursuit-n6", "dcc-md", runs) for runs in (98, 7, 1)),
    Cohort("navigation-n8", "dcc-md", 49),
    Cohort("waterworld-n8", "maddpg-md", 24),
)
"""In the order of what one wants to know; the first two have an aim (benchmarks/NOTES.md).

A run of waterworld remembers 2.3 GiB.
"""


def in_the_middle(cohort: Cohort, device: str) -> Training:
    """A training whose memory counts as full, so that minibatches come from all over it."""
    known = catalogue()
    named = known.algorithm(cohort.algorithm)
    settings: dict[str, Any] = {
        **known.sizes(cohort.environment, named.learner).algorithm,
        **named.overrides,
        **({} if device == "cuda" else {"replay_capacity": 800}),
    }
    specs = [
        RunSpec(
            environment=cohort.environment,
            environment_config=known.environment(cohort.environment),
            algorithm=named.learner,
            algorithm_config=named.config_class(**settings),
            training=TrainingSpec(),
            seed=seed,
        )
        for seed in range(1, cohort.runs + 1)
    ]
    training = Training(specs, device)
    training.begin()
    starts = training.learner.config.replay_start_env_steps
    training.replay.added = max(training.replay.slots, starts)
    training.env_steps = training.replay.added * training.games_each
    return training


def throughput(cohort: Cohort, device: str, graphs: bool) -> dict[str, float]:
    """Env steps per second of all runs together, ms of a step of all games, and memory."""
    cuda = device == "cuda"
    if cuda:
        torch.cuda.empty_cache()
        torch.cuda.reset_peak_memory_stats()
    training = in_the_middle(cohort, device)
    chunks = Chunks(training, recorder(device) if graphs else None)
    start = time.perf_counter()
    for _ in range(WARM_CHUNKS if graphs else 5):
        chunks.advance(STEPS)
    _finish(cuda)
    warm_s, start, first = time.perf_counter() - start, time.perf_counter(), training.env_steps
    while time.perf_counter() - start < (SECONDS if cuda else 0.2):
        for _ in range(1 if graphs else STEPS):
            chunks.advance(STEPS)
        _finish(cuda)
    wall = time.perf_counter() - start
    steps = (training.env_steps - first) / training.games_each
    row = {
        "env_steps_per_s": cohort.runs * training.games_each * steps / wall,
        "ms_a_step": 1e3 * wall / steps,
        "warm_s": warm_s,
    }
    return {**row, "peak_gib": torch.cuda.max_memory_allocated() / 2**30} if cuda else row


def kernels(cohort: Cohort, device: str) -> dict[str, Any]:
    """The kernels of a step with its updates: how many, how long, and the longest kinds.

    On a GPU those of a recorded chunk, by the step; on the CPU torch's operators.
    """
    cuda = device == "cuda"
    training = in_the_middle(cohort if cuda else Cohort("pursuit-n6", "dcc-md", 1), device)
    chunks = Chunks(training, recorder(device))
    for _ in range(WARM_CHUNKS if cuda else 3):
        chunks.advance(STEPS)
    activity = torch.profiler.ProfilerActivity
    first = training.env_steps
    with torch.profiler.profile(activities=[activity.CUDA if cuda else activity.CPU]) as profile:
        chunks.advance(STEPS)
        _finish(cuda)
    steps = (training.env_steps - first) // training.games_each
    key = "self_device_time_total" if cuda else "self_cpu_time_total"
    found = sorted(profile.key_averages(), key=lambda e: getattr(e, key), reverse=True)
    lines = [
        f"{getattr(e, key) / steps:9.1f} us {e.count / steps:6.1f} times  {e.key[:100]}"
        for e in found[:40]
    ]
    busy_us = sum(getattr(e, key) for e in found) / steps
    return {"kernels": sum(e.count for e in found) / steps, "busy_us": busy_us, "lines": lines}


def _finish(cuda: bool) -> None:
    if cuda:
        torch.cuda.synchronize()
