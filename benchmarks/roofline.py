"""How near an update comes to what the machine allows: `python -m benchmarks.roofline`.

    python -m benchmarks.roofline [--environment NAME] [--seconds 0.5] [--blocks 10]
    python -m benchmarks.roofline --growth FIGURE.png

The floor of an update is the longer of two times: its multiply-adds at the speed of a large matrix
product, and its bytes at the fastest of three copies. It is the longer one and not the sum, since
one agent's weights can be fetched while another's are multiplied, and whoever says how far away
the floor is should not lift it. For the same reason the copies are a large one, one of as many
bytes as the update moves, and Adam on as many parameters: a run's weights live in the cache, where
the large copy's speed would make the floor look higher than it is.

`dense` counts all products, `nonzero` only those of the first layers' inputs that are not 0, by
the share measured in the replay and by the messages that are not dropped. The update takes in the
sampling of its minibatch. Ceilings and times are the best of short blocks that take turns, in
seconds of this process: what others do on a shared machine is not counted.
"""

import argparse
import os
import sys
from pathlib import Path
from typing import NamedTuple

import torch

from benchmarks import ceilings, engine, growth
from benchmarks.counting import DENSE, Cost
from benchmarks.plain.stopwatch import PARTS
from benchmarks.updates import CASES, learning_ms, parameters, shares, update_cost, update_ms
from msgdrop_cli.engine import arithmetic
from msgdrop_cli.engine.training import Training
from msgdrop_cli.kernels.build import why_torch

ASKED = {"pursuit-n6": 1.5, "pursuit-n8": 1.5, "navigation-n8": 1.7, "waterworld-n8": 2.0}
"""Times the floor that an update should take at most."""


class Measured(NamedTuple):
    """The best of the blocks: ceilings by name, and ms per update of each part."""

    multiply_adds_per_s: float
    bytes_per_s: dict[str, float]
    ms: dict[str, float]

    def floor_ms(self, cost: Cost) -> float:
        """The longer of arithmetic and traffic."""
        return max(*self.both_ms(cost))

    def both_ms(self, cost: Cost) -> tuple[float, float]:
        """Arithmetic and traffic."""
        fastest = max(self.bytes_per_s.values())
        return 1e3 * cost.multiply_adds / self.multiply_adds_per_s, 1e3 * cost.bytes / fastest


def measure(training: Training, seconds: float, blocks: int) -> Measured:
    """Ceilings and training in turn."""
    moved = update_cost(training, DENSE).bytes
    products, copies, rows = [], [], []
    for _ in range(blocks):
        products.append(ceilings.multiply_adds_per_s())
        copies.append(
            {
                "large copy": ceilings.copied_bytes_per_s(ceilings.LARGE_BYTES),
                "copy of the update's size": ceilings.copied_bytes_per_s(moved),
                "Adam": ceilings.adam_bytes_per_s(parameters(training)),
            }
        )
        rows.append(update_ms(training, seconds))
    fastest = {name: max(copy[name] for copy in copies) for name in copies[0]}
    return Measured(max(products), fastest, min(rows, key=learning_ms))


def report(environment: str, seconds: float, blocks: int) -> None:
    """Print one case."""
    training = engine.prepared(engine.spec(environment, CASES[environment]))
    found = measure(training, seconds, blocks)
    left = shares(training)
    print(
        f"\n{environment}, {CASES[environment]}: {parameters(training):,} parameters;"
        f" {left.nonzero:.1%} of the observations are not 0, {left.kept:.0%} of the messages pass"
    )
    copies = ", ".join(f"{name} {speed / 1e9:.0f}" for name, speed in found.bytes_per_s.items())
    print(f"  G multiply-adds/s: {found.multiply_adds_per_s / 1e9:.0f}; GB/s: {copies}")
    print(f"  asked for: at most {ASKED[environment]:g} times the floor")
    for name, counted in (("dense", DENSE), ("nonzero", left)):
        cost = update_cost(training, counted)
        arithmetic, traffic = found.both_ms(cost)
        times = learning_ms(found.ms) / found.floor_ms(cost)
        print(
            f"  {name:8}{cost.multiply_adds / 1e6:6.1f} M multiply-adds = {arithmetic:.2f} ms,"
            f" {cost.bytes / 1e6:5.1f} MB = {traffic:.2f} ms; floor {found.floor_ms(cost):.2f} ms,"
            f" measured {learning_ms(found.ms):.2f} ms: {times:.1f} times"
        )
    parts = ", ".join(f"{part} {found.ms[part]:.3f}" for part in PARTS)
    print(f"  ms an update, and what lies between two: {parts}", flush=True)


@arithmetic.settled()
def main() -> None:
    """Print every case, or draw the growth."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--environment", choices=CASES, help="this one only")
    parser.add_argument("--seconds", type=float, default=0.5, help="length of a block")
    parser.add_argument("--blocks", type=int, default=10)
    parser.add_argument("--growth", type=Path, metavar="FIGURE", help="draw N = 4 to 16 instead")
    options = parser.parse_args()
    if os.environ.get("OMP_NUM_THREADS") != "1":
        sys.exit("set OMP_NUM_THREADS=1: numpy's products are to take one core, as torch's do")
    print(f"one thread, {why_torch() or 'compiled'}, {torch.backends.cpu.get_cpu_capability()}")
    if options.growth:
        growth.draw(options.growth, options.seconds, options.blocks)
        return
    for environment in [options.environment] if options.environment else CASES:
        report(environment, options.seconds, options.blocks)


if __name__ == "__main__":
    main()
