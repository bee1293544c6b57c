"""A plan as a Slurm job array: one element a seed, each a command that can be given again."""

import math
from collections.abc import Sequence
from shlex import quote

from msgdrop_cli import __version__
from msgdrop_cli.commands.parts import console
from msgdrop_cli.commands.parts.estimate import Estimate, cohorts, estimate, finished_runs
from msgdrop_cli.commands.parts.options import TrainOptions
from msgdrop_cli.commands.parts.survey import Survey
from msgdrop_cli.definition.plan import Plan, plan
from msgdrop_cli.definition.spec import Definition
from msgdrop_cli.errors import DefinitionError

_NOTICE_S = 120
"""How long before its time is up a job hears of it: a checkpoint takes ten seconds at most."""
_ROUND_S = 600
_SPARE_BYTES = 700e6
"""What the program itself takes, workers included, beside the memory of the runs."""


def show_job_array(name: str, definition: Definition, options: TrainOptions) -> int:
    """Print the plan as a job array; nothing is trained or looked up.

    name: the question as it was typed. Raises DefinitionError.
    """
    from msgdrop_cli.engine.offers import catalogue

    if options.json:
        raise DefinitionError("--emit prints a script, which is no JSON; leave out --json")
    if options.cluster:
        raise DefinitionError("--emit: a job of an array trains by itself; leave out --cluster")
    if options.to_next_look:
        raise DefinitionError("--emit: an array is of seeds that are known; give --seeds a number")
    asked, one = (
        plan(
            definition,
            options.profile,
            catalogue(),
            overrides=options.overrides,
            readings=options.readings,
            seeds=seeds,
        )
        for seeds in (options.seeds, (1,))
    )
    everything = Survey(runs=one.runs, records={})
    element = estimate(
        everything,
        cohorts(everything.pending, options.device),
        finished_runs(options.results),
        workers=options.workers,
        device=options.device,
        episodes=one.evaluation_episodes,
        evaluations=len(one.channels),
        machine=options.workers,
    )
    console.result(job_array(name, asked, options, element))
    return 0


def job_array(name: str, asked: Plan, options: TrainOptions, element: Estimate) -> str:
    """The script for `sbatch`, to be read and changed by people.

    name: the question as it was typed. element: what all runs of one seed take.
    Raises DefinitionError for what would end the script's own comments.
    """
    if any(not word.isprintable() for word in (name, *options.overrides, str(options.results))):
        raise DefinitionError("--emit: a name with line breaks cannot stand in a script")
    seeds = sorted({run.spec.seed for run in asked.runs})
    command = _command(name, options)
    title = f"{asked.definition.name}-{asked.profile}"
    everything = f"{command} --seeds {','.join(map(str, seeds))}{',' * (len(seeds) == 1)}"
    lines = (
        "#!/bin/bash",
        f"# Written by msgdrop {__version__}: {title}, an element of the array for each seed.",
        "# What is finished is not trained again, and what was stopped goes on: submit this once",
        "# more after a crash or when the time was too short. The answer, when all have ended:",
        f"#   {everything}",
        f"#SBATCH --job-name={title}",
        f"#SBATCH --array={_array(seeds)}",
        f"#SBATCH --cpus-per-task={_processes(asked, seeds, options)}",
        *(["#SBATCH --gpus=1"] if options.device == "cuda" else []),
        f"#SBATCH --mem={math.ceil((element.memory_bytes + _SPARE_BYTES) / 1e6)}M",
        f"#SBATCH --time={_time(element.seconds_range[1])}",
        f"#SBATCH --signal=B:TERM@{_NOTICE_S}",
        "#SBATCH --requeue",
        "#SBATCH --open-mode=append",
        "#SBATCH --output=%x-%a.log",
        "set -euo pipefail",
        "# exec: the signal before the time is up must reach msgdrop, which writes checkpoints.",
        f'exec {command} --seeds "${{SLURM_ARRAY_TASK_ID}},"',
    )
    return "\n".join(lines)


def _command(name: str, options: TrainOptions) -> str:
    words = ["msgdrop", "ablate", name, "--profile", options.profile]
    words += [word for each in options.readings for word in ("--reading", each)]
    words += [word for each in options.overrides for word in ("--set", each)]
    words += ["--workers", str(options.workers), "--device", options.device]
    words += ["--results", str(options.results)]
    return " ".join(map(quote, words))


def _processes(asked: Plan, seeds: Sequence[int], options: TrainOptions) -> int:
    return min(options.workers, len(asked.runs) // len(seeds))


def _array(seeds: Sequence[int]) -> str:
    """`1-10` without gaps, else `1,5,9`."""
    if len(seeds) > 1 and seeds[-1] - seeds[0] == len(seeds) - 1:
        return f"{seeds[0]}-{seeds[-1]}"
    return ",".join(map(str, seeds))


def _time(seconds: float) -> str:
    """`1-02:10:00`: in whole ten minutes, with room for the notice."""
    whole = math.ceil((seconds + _NOTICE_S) / _ROUND_S) * _ROUND_S
    days, rest = divmod(whole, 86_400)
    return f"{days}-{rest // 3600:02}:{rest % 3600 // 60:02}:00"
