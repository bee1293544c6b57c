"""How fast the engine trains on one core, against `plain.py`, and what memory it takes.

    python -m benchmarks.throughput [--seconds 3] [--blocks 5]

Both are measured in the same run, in short blocks that take turns, since the speed of a shared
machine drifts: the ratio is the figure, the env steps per second are not. Everything is
included that a training does between two logs: acting, the game, storing, sampling, updating.
"""

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

import torch

from benchmarks import plain
from msgdrop_cli.definition.spec import RunSpec, TrainingSpec
from msgdrop_cli.engine.catalogue import catalogue
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.training import Training
from msgdrop_cli.networks.kernel import kernel_name
from msgdrop_envs import autoreset, registry

P = ParamSpec("P")
T = TypeVar("T")
PARTS = ("act", "step", "sample", "update")
PUBLISHED = Path(__file__).parents[1] / "results" / "published"
WARM_ENV_STEPS = 10_000
"""As many random transitions as `plain.py` has before its clock starts."""


def engine(environment: str, algorithm: str, *, runs: int = 1) -> Training:
    """A cohort at the paper's settings whose replay holds WARM_ENV_STEPS of random play.

    Epsilon is held at the value that `plain.py` takes, so that both explore alike.
    """
    known = catalogue()
    named = known.algorithm(algorithm)
    config = named.config_class(
        **known.paper_algorithm[environment, named.learner],
        **named.overrides,
        replay_start_env_steps=0,
        epsilon_start=plain.EPSILON,
        epsilon_final=plain.EPSILON,
    )
    specs = [
        RunSpec(
            environment=environment,
            environment_config=known.environment(environment),
            algorithm=named.learner,
            algorithm_config=config,
            training=TrainingSpec(),
            seed=seed,
        )
        for seed in range(1, runs + 1)
    ]
    training = Training(specs)
    training.begin()
    shape = (runs, training.games_each, training.env.agents)
    while training.env_steps < WARM_ENV_STEPS:
        training.play(torch.randint(training.env.actions, shape))
    for _ in range(10):
        training.advance()
    return training


def measure(training: Training, seconds: float) -> dict[str, float]:
    """Env steps per second with learning, all runs counted, and ms of each part per env step."""
    spent = dict.fromkeys(PARTS, 0.0)
    first, start = training.env_steps, time.perf_counter()

    def timed(part: str, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        begin = time.perf_counter()
        result = call(*args, **kwargs)
        spent[part] += time.perf_counter() - begin
        return result

    while time.perf_counter() - start < seconds:
        actions = timed("act", training.act)
        timed("step", training.play, actions)
        for _ in range(training.updates_due()):
            timed("update", training.learn, timed("sample", training.sample))
    wall = time.perf_counter() - start
    steps = (training.env_steps - first) * training.runs
    return {"env_steps_per_s": steps / wall, **{p: 1e3 * s / steps for p, s in spent.items()}}


def compare(environment: str, seconds: float, blocks: int) -> dict[str, object]:
    """The engine's DCC-MD 0.2 and `plain.py`'s in turn; medians, and the ratio block by block."""
    training = engine(environment, "dcc-md")
    pairs = [
        (measure(training, seconds), plain.measure(environment, seconds)) for _ in range(blocks)
    ]
    ratios = sorted(ours["env_steps_per_s"] / theirs["env_steps_per_s"] for ours, theirs in pairs)
    rows = {}
    for name, side in (("engine", 0), ("plain", 1)):
        keys = ("env_steps_per_s", *PARTS)
        rows[name] = {key: statistics.median(pair[side][key] for pair in pairs) for key in keys}
    rows["ratio"] = {"median": statistics.median(ratios), "min": ratios[0], "max": ratios[-1]}
    return {"environment": environment, "algorithm": "dcc-md", **rows}


def environment_alone(environment: str, games: int, seconds: float) -> float:
    """Joint steps per second of the game with observations, random actions, no learner."""
    env = registry.make(environment)
    state = autoreset.start(
        env, torch.rand(1, games, env.reset_uniforms), torch.zeros(1, games, dtype=torch.long)
    )
    shape = (1, games, env.agents)
    if env.action_size:
        actions = torch.rand(*shape, env.action_size) * 2 - 1
    else:
        actions = torch.randint(env.actions, shape)
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
        evaluate(policy.parent, broken_links=0.0, episodes=1_000)
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
    training = engine(environment, "dcc-md")
    training.replay.obs.fill_(1)  # every page of the full memory
    training.replay.reward.fill_(0)
    for _ in range(20):
        training.advance()
    after = _resident_mb()
    capacity = training.learner.config.replay_capacity
    return {"replay_capacity": capacity, "libraries": before, "run": after - before}


def _resident_mb() -> float:
    """Memory that this process holds now (getrusage's peak would be its parent's)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1024


def main() -> None:
    """Print everything, as tables for people."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=3.0, help="length of a block")
    parser.add_argument("--blocks", type=int, default=5)
    parser.add_argument("--memory-of", help=argparse.SUPPRESS)
    options = parser.parse_args()
    torch.set_num_threads(1)
    torch.set_grad_enabled(False)
    if options.memory_of:
        print(json.dumps(memory_here(options.memory_of)))
        return
    print(f"one thread, kernel {kernel_name()!r}, {torch.backends.cpu.get_cpu_capability()}")
    print(f"{'':22}{'env steps/s':>12}" + "".join(f"{part:>10}" for part in PARTS))
    for environment in plain.CASES:
        with torch.enable_grad():  # plain.py uses autograd
            result = compare(environment, options.seconds, options.blocks)
        for name in ("engine", "plain"):
            row = result[name]
            assert isinstance(row, dict)
            parts = "".join(f"{row[part]:10.3f}" for part in PARTS)
            print(f"{environment} {name:<10}{row['env_steps_per_s']:13.0f}{parts}  ms/env step")
        ratio = result["ratio"]
        assert isinstance(ratio, dict)
        print(f"{'':11}ratio {ratio['median']:.2f} ({ratio['min']:.2f} to {ratio['max']:.2f})")
        speeds = ", ".join(
            f"{environment_alone(environment, games, 1.0):,.0f} with {games:,} games"
            for games in (1, 32, 1024)
        )
        print(f"{'':11}game alone, joint steps/s: {speeds}")
    for name, seconds in evaluation():
        print(f"1,000 greedy episodes of {name}: {seconds:.1f} s")
    used = memory("pursuit-n6")
    print(
        f"memory of one pursuit-n6 run, replay {used['replay_capacity']:,.0f} full:"
        f" {used['run']:.0f} MB above {used['libraries']:.0f} MB of libraries"
    )


if __name__ == "__main__":
    main()
