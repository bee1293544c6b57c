"""A study of thousands of runs: what its records cost `status`, `plot`, `reproduce` and the others.

    python -m benchmarks.thousands FOLDER [RUNS]

makes the folder of the published records, RUNS of them (10,000), if it is not there yet, and prints
the CPU time of every command, the first time and again. Each arm of the questions below has as many
seeds as are needed; a seed's logs are those of a published one, under links, so a disk is hardly
read and the numbers are of parsing and of analysis.
"""

import json
import os
import resource
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from msgdrop_cli.definition.run_id import run_id, spec_from_dict
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.records.packed import log_bytes
from msgdrop_cli.records.store import EPISODES, METRICS, RUN, RUNS, RunRecord, list_runs

RUNS_ASKED = 10_000
STUDIES = ("dropout-rate-two-million", "navigation-million-nearest")
"""Published ones: pursuit N = 6 through three channels, and navigation N = 8 and N = 10."""
PUBLISHED = Path(__file__).parents[1] / "results" / "published"
COMMANDS = (
    *(("status",), ("plot",), ("reproduce",), ("export",), ("verify",)),
    *(("results",), ("curves",)),
)
_PYTHON = "import sys, msgdrop_cli; getattr(msgdrop_cli, sys.argv[1])(sys.argv[2])"


def make(root: Path, runs: int) -> None:
    """Write the folders of so many finished runs of our own, not published ones."""
    records = [record for name in STUDIES for record in list_runs(PUBLISHED / name)]
    arms: dict[tuple[str, str], list[RunRecord]] = {}
    for record in sorted(records, key=lambda each: each.seed):
        arms.setdefault((record.environment, record.variant), []).append(record)
    for number in range(runs):
        seed, place = divmod(number, len(arms))
        arm = [*arms.values()][place]
        _write(root, arm[seed % len(arm)], seed + 1)


def _write(root: Path, record: RunRecord, seed: int) -> None:
    """The run with another seed, and so with another id; its logs are the same files for all."""
    spec = {**record.spec, "seed": seed}
    name = run_id(spec_from_dict(spec, catalogue()))
    folder = root / RUNS / record.environment / f"{record.variant}-s{seed}-{name}"
    folder.mkdir(parents=True)
    (folder / RUN).write_text(json.dumps(record.run | {"seed": seed, "run_id": name, "spec": spec}))
    for log in (METRICS, EPISODES):
        unpacked = root / "logs" / f"{record.run_id}-{log}"
        if not unpacked.exists():
            unpacked.parent.mkdir(exist_ok=True)
            unpacked.write_bytes(log_bytes(record.path / log) or b"")
        os.link(unpacked, folder / log)


def measure(root: Path, command: Sequence[str]) -> float:
    """Seconds of user and system time that a command takes in a process of its own."""
    program = ["-c", _PYTHON] if command[0] in ("results", "curves") else ["-m", "msgdrop_cli"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, *program, *command, str(root)],
        check=True,
        stdout=subprocess.DEVNULL,
        env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(root: Path, runs: int) -> None:
    """Make the folder where it is missing, then measure every command twice."""
    if not root.exists():
        root.mkdir(parents=True)
        make(root, runs)
    for command in COMMANDS:
        first, again = (measure(root, command) for _ in range(2))
        print(f"{' '.join(command):<12}{first:8.1f} s {again:8.1f} s again", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else RUNS_ASKED)
