"""A job array from submission to answer, with an `sbatch` that runs its elements here."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from msgdrop_cli.records.store import list_runs
from tests.cli_runs import QUESTION, msgdrop
from tests.dask_processes import DASK
from tests.processes import wait_for

pytestmark = pytest.mark.slow
SBATCH = r"""#!/bin/bash
# As Slurm does it: the options stand in comments, each element is a process with its number.
set -euo pipefail
option() { sed -n "s/^#SBATCH --$1=//p" "$script"; }
script=$1 status=0
IFS=- read -r first last <<< "$(option array)"
for ((number = first; number <= last; number++)); do
    log=$(option output)
    log=${log//%x/$(option job-name)}
    SLURM_ARRAY_TASK_ID=$number bash "$script" >> "${log//%a/$number}" 2>&1 &
    echo "$!" > "$number.pid"
done
for ((number = first; number <= last; number++)); do
    wait "$(< "$number.pid")" || status=$?
done
exit "$status"
"""


def submitted(folder: Path) -> subprocess.Popen[bytes]:
    """The array, handed in: it ends when all elements have."""
    path = f"{folder}:{os.environ['PATH']}"
    return subprocess.Popen(["sbatch", "array.sh"], env=DASK | {"PATH": path}, cwd=folder)


def test_an_array_goes_on_after_a_kill(tmp_path: Path) -> None:
    """One element is killed, one hears that its time is up; submitted once more, all is done."""
    here = f'#!/bin/sh\nexec {sys.executable} -m msgdrop_cli "$@"\n'
    for name, text in (("sbatch", SBATCH), ("msgdrop", here)):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    question, results = tmp_path / "tiny.toml", tmp_path / "results"
    question.write_text(QUESTION.replace("train_env_steps = 200", "train_env_steps = 2_000"))
    asked = (
        "ablate",
        question,
        "--workers",
        "1",
        "--set",
        "training.checkpoint_every_env_steps=100",
    )
    array = msgdrop(*asked, "--results", results, "--emit", "slurm").out
    (tmp_path / "array.sh").write_text(array)

    first = submitted(tmp_path)
    wait_for(lambda: len(list(results.glob("runs/*/*/checkpoints/*/MANIFEST.json"))) >= 2, 120.0)
    pids = [(tmp_path / f"{number}.pid").read_text().strip() for number in (1, 2)]
    subprocess.run(["kill", "-KILL", pids[0]], check=True)
    subprocess.run(["kill", "-TERM", pids[1]], check=True)
    assert first.wait() == 143  # the element that was told; it wrote a checkpoint
    assert "done" not in {run.status for run in list_runs(results)}

    assert submitted(tmp_path).wait() == 0
    assert {run.status for run in list_runs(results)} == {"done"}
    assert "went on" not in (tmp_path / "tiny-quick-2.log").read_text()
    answer = msgdrop(*asked, "--results", results)
    assert "nothing to train" in answer.err
