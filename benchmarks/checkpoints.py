"""What checkpoints cost a run of the paper's size: python -m benchmarks.checkpoints [env steps].

Trains DCC-MD in pursuit N=6 with the defaults, the replay memory of 200,000 steps included; says of
each checkpoint, and of the whole training, what it took of wall time and of the processor. The aim
is 2% of the wall time.
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from msgdrop_cli.definition.plan import ad_hoc_definition, plan
from msgdrop_cli.definition.spec import Profile
from msgdrop_cli.engine import run as run_module
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.engine.run import train_cohort

STEPS = 600_000


class Cost(NamedTuple):
    """One checkpoint, or the training around it."""

    env_steps: int
    wall_s: float
    cpu_s: float


def measure(steps: int, root: Path) -> tuple[list[Cost], Cost]:
    """The checkpoints of one training, and the whole of it."""
    profile = Profile(seeds=1, training={"train_env_steps": steps})
    question = ad_hoc_definition("pursuit-n6", ["dcc-md"], "checkpoints", profile)
    [planned] = plan(question, "checkpoints", catalogue()).runs
    taken: list[Cost] = []
    save = run_module._Session._checkpoint

    def timed(session: run_module._Session) -> None:
        wall, cpu = time.perf_counter(), time.process_time()
        save(session)
        spent = time.perf_counter() - wall, time.process_time() - cpu
        taken.append(Cost(session.training.env_steps, *spent))
        print(f"{taken[-1].env_steps:>9,}  {spent[0]:.2f} s, {spent[1]:.2f} s of the processor")

    run_module._Session._checkpoint = timed  # type: ignore[method-assign, assignment]
    wall, cpu = time.perf_counter(), time.process_time()
    [outcome] = train_cohort([planned], root)
    return taken, Cost(outcome.env_steps, time.perf_counter() - wall, time.process_time() - cpu)


def main() -> None:
    """Measure and print."""
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else STEPS
    with tempfile.TemporaryDirectory() as folder:
        taken, whole = measure(steps, Path(folder))
    for name, spent, total in (
        ("wall time", sum(each.wall_s for each in taken), whole.wall_s),
        ("processor", sum(each.cpu_s for each in taken), whole.cpu_s),
    ):
        print(f"{name}: {spent:.2f} of {total:.1f} s, {spent / total:.2%}")


if __name__ == "__main__":
    main()
