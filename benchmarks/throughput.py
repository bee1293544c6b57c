"""How fast the engine trains on one core, against `plain`, and what memory it takes.

    python -m benchmarks.throughput [--environment NAME] [--algorithm NAME] [--seconds 3]

Both are measured in the same run, in short blocks that take turns, since the speed of a shared
machine drifts: the ratio is the figure, the env steps per second are not. Everything is
included that a training does between two logs: acting, the game, storing, sampling, updating.
Without a filter memory and evaluation are measured, too.
"""

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import torch

from benchmarks import engine
from benchmarks.plain import measure as plain
from benchmarks.plain.stopwatch import PARTS
from msgdrop_cli.definition.channel import NONE_BROKEN
from msgdrop_cli.engine import arithmetic
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.kernels.build import why_torch
from msgdrop_envs import autoreset, registry

PUBLISHED = Path(__file__).parents[1] / "results" / "published"
ASKED_RATIO = {
    ("pursuit-n6", "dcc-md"): 15,
    ("pursuit-n8", "dcc-md"): 12,
    ("navigation-n8", "dcc-md"): 15,
    ("waterworld-n8", "maddpg-md"): 9,
}
"""Times the plain implementation's speed that the engine should reach at least."""
ASKED_ALONE = {
    ("pursuit-n6", 1024): 300_000,
    ("navigation-n8", 1024): 150_000,
    ("waterworld-n8", 1024): 40_000,
}
"""Joint steps per second that so many games alone should reach at least."""
GAMES = (1, 32, 1024)


class Comparison(NamedTuple):
    """Medians of env steps per second and of ms per env step and part; the ratio by blocks."""

    engine: dict[str, float]
    plain: dict[str, float]
    ratios: list[float]
    """Sorted."""


def compare(environment: str, algorithm: str, seconds: float, blocks: int) -> Comparison:
    """The engine and the plain implementation in turn."""
    with torch.inference_mode(False):  # the plain implementation uses autograd
        theirs = plain.prepared(environment, algorithm)
    ours = engine.prepared(engine.spec(environment, algorithm))
    fast, slow = [], []
    for _ in range(blocks):
        fast.append(engine.measure(ours, seconds))
        with torch.inference_mode(False):
            slow.append(plain.measure(theirs, seconds))
    key = "env_steps_per_s"
    ratios = sorted(one[key] / other[key] for one, other in zip(fast, slow, strict=True))
    return Comparison(_medians(fast), _medians(slow), ratios)


def environment_alone(environment: str, games: int, seconds: float) -> float:
    """Joint steps per second of the game with observations, random actions, no learner."""
    env = registry.make(environment)
    state = autoreset.start(
        env, torch.rand(1, games, env.reset_uniforms), torch.zeros(1, games, dtype=torch.long)
    )
    actions = engine.random_actions(env, 1, games)
    uniforms = torch.rand(1, games, env.step_uniforms)
    fresh = torch.rand(1, games, env.reset_uniforms)
    steps, start = 0, time.perf_counter()
    while time.perf_counter() - start < seconds:
        state, _ = autoreset.step(env, state, actions, uniforms, fresh)
        steps += games
    return steps / (time.perf_counter() - start)


def evaluation() -> list[tuple[str, float]]:
    """Seconds that 1,000 greedy episodes of each published policy take."""
    timed = []
    for policy in sorted(PUBLISHED.rglob("policy.safetensors")):
        start = time.perf_counter()
        evaluate(policy.parent, channel=NONE_BROKEN, episodes=1_000)
        timed.append((policy.parent.name, time.perf_counter() - start))
    return timed


def memory(environment: str) -> dict[str, float]:
    """MB that one run takes with its replay full, above the imported libraries (a new process)."""
    command = [sys.executable, "-m", "benchmarks.throughput", "--memory-of", environment]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


def memory_here(environment: str) -> dict[str, float]:
    """The same, for this process."""
    before = _resident_mb()
    training = engine.prepared(engine.spec(environment, "dcc-md"))
    training.replay.obs.fill_(1)  # every page of the full memory
    training.replay.reward.fill_(0)
    for _ in range(20):
        training.advance()
    after = _resident_mb()
    capacity = training.learner.config.replay_capacity
    return {"replay_capacity": capacity, "libraries": before, "run": after - before}


@arithmetic.settled()
def main() -> None:
    """Print what was asked for, as tables for people."""
    known = sorted({algorithm for each in plain.CASES.values() for algorithm in each})
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--environment", choices=plain.CASES, help="this one only")
    parser.add_argument("--algorithm", choices=known, help="this one only")
    parser.add_argument("--seconds", type=float, default=3.0, help="length of a block")
    parser.add_argument("--blocks", type=int, default=5)
    parser.add_argument("--memory-of", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.memory_of:
        print(json.dumps(memory_here(options.memory_of)))
        return
    print(f"one thread, {why_torch() or 'compiled'}, {torch.backends.cpu.get_cpu_capability()}")
    print("ms per env step; an update's cost is spread over the env steps that it serves")
    print(f"{'':36}{'env steps/s':>12}" + "".join(f"{part:>9}" for part in PARTS))
    environments = [options.environment] if options.environment else list(plain.CASES)
    for environment in environments:
        for algorithm in plain.CASES[environment]:
            if options.algorithm in (None, algorithm):
                result = compare(environment, algorithm, options.seconds, options.blocks)
                _print_comparison(environment, algorithm, result)
    for environment in environments:
        _print_alone(environment)
    if options.environment is None and options.algorithm is None:
        _print_evaluation_and_memory()


def _print_comparison(environment: str, algorithm: str, result: Comparison) -> None:
    for name, row in (("engine", result.engine), ("plain", result.plain)):
        parts = "".join(f"{row[part]:9.3f}" for part in PARTS)
        speed = f"{row['env_steps_per_s']:12,.0f}"
        print(f"{environment:14}{algorithm:15}{name:7}{speed}{parts}", flush=True)
    low, high = result.ratios[0], result.ratios[-1]
    asked = ASKED_RATIO.get((environment, algorithm))
    wanted = f", asked for: {asked}" if asked else ""
    print(f"{'':29}ratio {statistics.median(result.ratios):.2f} ({low:.2f} to {high:.2f}){wanted}")


def _print_alone(environment: str) -> None:
    speeds = []
    for games in GAMES:
        asked = ASKED_ALONE.get((environment, games))
        wanted = f" (asked for: {asked:,})" if asked else ""
        speeds.append(f"{environment_alone(environment, games, 1.0):,.0f} with {games:,}{wanted}")
    print(f"{environment:14}games alone, joint steps/s: {', '.join(speeds)}", flush=True)


def _print_evaluation_and_memory() -> None:
    for name, seconds in evaluation():
        print(f"1,000 greedy episodes of {name}: {seconds:.1f} s")
    used = memory("pursuit-n6")
    print(
        f"memory of one pursuit-n6 run, replay {used['replay_capacity']:,.0f} full:"
        f" {used['run']:.0f} MB above {used['libraries']:.0f} MB of libraries"
    )


def _medians(rows: Sequence[dict[str, float]]) -> dict[str, float]:
    return {key: statistics.median(row[key] for row in rows) for key in rows[0]}


def _resident_mb() -> float:
    """Memory that this process holds now (getrusage's peak would be its parent's)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1024


if __name__ == "__main__":
    main()
