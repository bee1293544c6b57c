"""How an update's time grows with the number of agents, beside its multiply-adds."""

import dataclasses
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from benchmarks import engine
from benchmarks.counting import DENSE
from benchmarks.updates import CASES, learning_ms, shares, update_cost, update_ms
from msgdrop_cli.definition.spec import RunSpec

AGENTS = (4, 6, 8, 10, 12, 16)
MULTIPLES = (1, 2, 5, 10, 20)
"""Ticks of the figure."""
VARIED = {
    "pursuit-n6": ("pursuers",),
    "navigation-n8": ("agents", "landmarks"),
    "waterworld-n8": ("pursuers",),
}
"""Environment: the fields that say how many there are; everything else stays as it is."""
REPLAY_CAPACITY = 20_000
"""Little memory for many agents; more than is filled."""


class Point(NamedTuple):
    """One update with so many agents."""

    agents: int
    dense: float
    """Multiply-adds, all of them."""
    nonzero: float
    """Those that are not by zero."""
    ms: float
    """Sampling and learning."""


def draw(path: Path, seconds: float, blocks: int) -> None:
    """Measure all sizes, print them as multiples of the smallest, and write the figure."""
    figure = Figure(figsize=(3.6 * len(VARIED), 3.6), layout="constrained")
    panels = figure.subplots(1, len(VARIED), sharey=True)
    for axes, environment in zip(panels, VARIED, strict=True):
        points = measure(environment, seconds, blocks)
        print(f"{environment}, {CASES[environment]}: ms an update; all as multiples of the first")
        for point in points:
            dense, nonzero, time = _multiples(point, points[0])
            print(
                f"  N={point.agents:<4}{point.ms:7.2f} ms; time {time:6.2f}, multiply-adds"
                f" {dense:6.2f} (nonzero {nonzero:6.2f})",
                flush=True,
            )
        lines = zip(*(_multiples(point, points[0]) for point in points), strict=True)
        labels = ("multiply-adds", "those not by zero", "time")
        for line, label, style in zip(lines, labels, ("k-", "k:", "C0o-"), strict=True):
            axes.loglog(AGENTS, line, style, label=label)
        axes.set_xticks(AGENTS, [str(agents) for agents in AGENTS])
        axes.set_yticks(MULTIPLES, [str(multiple) for multiple in MULTIPLES])
        axes.minorticks_off()
        axes.set(title=f"{environment.split('-')[0]}, {CASES[environment]}", xlabel="agents")
    figure.axes[0].set_ylabel(f"one update, multiples of N = {AGENTS[0]}")
    figure.axes[0].legend()
    figure.savefig(path)


def measure(environment: str, seconds: float, blocks: int) -> list[Point]:
    """All sizes in turn, the best of the blocks."""
    trainings = [engine.prepared(sized(environment, agents)) for agents in AGENTS]
    best = [float("inf")] * len(AGENTS)
    for _ in range(blocks):
        for n, training in enumerate(trainings):
            best[n] = min(best[n], learning_ms(update_ms(training, seconds)))
    return [
        Point(
            agents,
            update_cost(training, DENSE).multiply_adds,
            update_cost(training, shares(training)).multiply_adds,
            ms,
        )
        for agents, training, ms in zip(AGENTS, trainings, best, strict=True)
    ]


def sized(environment: str, agents: int) -> RunSpec:
    """The paper's case with another number of agents."""
    run = smaller(engine.spec(environment, CASES[environment]))
    numbers = dict.fromkeys(VARIED[environment], agents)
    return dataclasses.replace(
        run, environment_config=dataclasses.replace(run.environment_config, **numbers)
    )


def smaller(run: RunSpec) -> RunSpec:
    """The same run with little memory."""
    config = dataclasses.replace(run.algorithm_config, replay_capacity=REPLAY_CAPACITY)
    return dataclasses.replace(run, algorithm_config=config)


def _multiples(point: Point, first: Point) -> tuple[float, float, float]:
    """Dense, nonzero and time, of the first point's."""
    return point.dense / first.dense, point.nonzero / first.nonzero, point.ms / first.ms
