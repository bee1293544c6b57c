"""What a second worker brings: env steps per second of two processes against one.

    python -m benchmarks.workers [--environment NAME] [--algorithm NAME]

Two processes train, each on one thread. In turn the first one works alone and both work at the
same time, since the speed of a shared machine drifts; what both do together, divided by what one
does alone, is the figure. Two runs share memory bandwidth and the last cache, so it is not quite 2.
"""

import argparse
import multiprocessing
from multiprocessing.connection import Connection

from benchmarks import engine
from msgdrop_cli.engine import arithmetic

ASKED = 1.9


def train(environment: str, algorithm: str, orders: Connection) -> None:
    """Train for as many seconds as each order says, and answer with env steps per second."""
    with arithmetic.settled():
        training = engine.prepared(engine.spec(environment, algorithm))
        orders.send("ready")
        while seconds := orders.recv():
            orders.send(engine.measure(training, seconds)["env_steps_per_s"])


def compare(environment: str, algorithm: str, seconds: float, blocks: int) -> list[float]:
    """The ratio of each block, sorted."""
    spawn = multiprocessing.get_context("spawn")
    workers: list[Connection] = []
    for _ in range(2):
        ours, theirs = spawn.Pipe()
        spawn.Process(target=train, args=(environment, algorithm, theirs), daemon=True).start()
        workers.append(ours)
    for worker in workers:
        worker.recv()
    ratios = [_speed(workers, seconds) / _speed(workers[:1], seconds) for _ in range(blocks)]
    for worker in workers:
        worker.send(0)
    return sorted(ratios)


def _speed(workers: list[Connection], seconds: float) -> float:
    """Env steps per second of these workers together, at the same time."""
    for worker in workers:
        worker.send(seconds)
    return sum(float(worker.recv()) for worker in workers)


def main() -> None:
    """Print one line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--environment", default="pursuit-n6")
    parser.add_argument("--algorithm", default="dcc-md")
    parser.add_argument("--seconds", type=float, default=3.0, help="length of a block")
    parser.add_argument("--blocks", type=int, default=5)
    options = parser.parse_args()
    ratios = compare(options.environment, options.algorithm, options.seconds, options.blocks)
    print(
        f"{options.environment} {options.algorithm}: two workers {ratios[len(ratios) // 2]:.2f}"
        f" times one ({ratios[0]:.2f} to {ratios[-1]:.2f}); asked for: {ASKED}"
    )


if __name__ == "__main__":
    main()
