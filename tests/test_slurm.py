"""`ablate --emit slurm`: a job array that a shell takes, asks for all seeds, and hears the end."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from msgdrop_cli.commands.parts.slurm import _array, _time
from tests.cli_runs import msgdrop

ASKED = ("ablate", "blockwise-vs-elementwise")
STUB = '#!/bin/sh\nfor word in "$@"; do echo "$word"; done\n'


def script(*options: str | Path) -> str:
    """What is printed instead of training."""
    said = msgdrop(*ASKED, "--emit", "slurm", *options)
    assert said.code == 0, said.err
    return said.out


def element(text: str, number: int, folder: Path) -> list[str]:
    """The words that one element of the array gives to `msgdrop`."""
    stub = folder / "msgdrop"
    stub.write_text(STUB)
    stub.chmod(0o755)
    environment = {"PATH": f"{folder}:{os.environ['PATH']}", "SLURM_ARRAY_TASK_ID": str(number)}
    done = subprocess.run(
        ["bash"], input=text, env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


def test_an_element_trains_its_seed_as_asked(tmp_path: Path) -> None:
    """What stands behind --set, --results and the rest reaches msgdrop word by word."""
    results = tmp_path / "a b $HOME 'c'"
    given = ("--set", "algorithm.gamma=0.9", "--workers", "3", "--results", results)
    words = element(script("--seeds", "4,7", *given), 7, tmp_path)
    assert words == [
        *(*ASKED, "--profile", "quick", "--set", "algorithm.gamma=0.9", "--workers", "3"),
        *("--device", "cpu", "--results", str(results), "--seeds", "7,"),
    ]
    assert not results.exists()


def test_the_array_has_an_element_for_each_seed() -> None:
    """The profile's seeds without --seeds, and those of a list."""
    assert "#SBATCH --array=1-2\n" in script()
    assert "#SBATCH --array=4,7\n" in script("--seeds", "7,4")


def test_the_end_of_the_time_reaches_msgdrop() -> None:
    """The signal goes to the batch shell, which msgdrop has replaced: nothing else can write."""
    text = script()
    assert "#SBATCH --signal=B:TERM@120\n" in text
    assert text.rstrip().splitlines()[-1].startswith("exec msgdrop ")


@pytest.mark.parametrize(
    ("seeds", "array"), [((1, 2, 3), "1-3"), ((1, 2, 4), "1,2,4"), ((5,), "5"), ((2, 3), "2-3")]
)
def test_seeds_are_written_as_slurm_reads_them(seeds: Sequence[int], array: str) -> None:
    """A range without gaps, or a list."""
    assert _array(seeds) == array


@pytest.mark.parametrize(
    ("seconds", "time"), [(1, "0-00:10:00"), (481, "0-00:20:00"), (100_000, "1-03:50:00")]
)
def test_the_time_is_never_less_than_was_estimated(seconds: float, time: str) -> None:
    """Rounded up to ten minutes, the notice before the end included."""
    assert _time(seconds) == time


@pytest.mark.skipif(
    not (shutil.which("shellcheck") or (Path(sys.executable).parent / "shellcheck").exists()),
    reason="needs shellcheck",
)
def test_shellcheck_has_nothing_to_say() -> None:
    """The script is one that people who write scripts would write."""
    program = shutil.which("shellcheck") or str(Path(sys.executable).parent / "shellcheck")
    done = subprocess.run([program, "-"], input=script(), capture_output=True, text=True)
    assert done.stdout == ""
    assert done.returncode == 0


def test_only_what_there_is_can_be_emitted() -> None:
    """One line, exit code 2; a line break would end a comment of the script."""
    said = msgdrop(*ASKED, "--emit", "pbs")
    assert (said.code, said.out) == (2, "")
    assert "'pbs' is unknown; there is slurm" in said.err
    said = msgdrop(*ASKED, "--emit", "slurm", "--results", "a\nrm -rf b")
    assert (said.code, said.out) == (2, "")
    assert re.search("line breaks", said.err)


@pytest.mark.parametrize(
    ("also", "says"),
    [
        (("--json",), "--emit prints a script, which is no JSON"),
        (("--cluster", "local:2"), "--emit: a job of an array trains by itself"),
    ],
)
def test_a_script_is_all_that_is_made(also: Sequence[str], says: str) -> None:
    """One line instead of a script that does less than was asked for."""
    said = msgdrop(*ASKED, "--emit", "slurm", *also)
    assert (said.code, said.out) == (2, "")
    assert says in said.err
