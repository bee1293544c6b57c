r"""Trains as much of a question as fits into some minutes, and packs what is finished.

    python benchmarks/campaign.py dropout-rate --profile paper --minutes 25 --out DIR \
        --device cuda --detach
    python benchmarks/campaign.py --status --out DIR
    msgdrop import DIR/*.zip                          # at home

For a machine that is lent for a while: nothing of msgdrop has to be installed there, and the same
command goes on where it stopped.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "envs"), str(ROOT / "ablations")]

# ruff: noqa: E402 (what is ours can be found only now)
from msgdrop_cli.signals import end_at_once
from msgdrop_cli.stopping import Stopped, graceful_stop

if __name__ == "__main__":
    end_at_once()  # not below: loading torch takes seconds

from benchmarks.limited_time import STATE, Campaign, counts
from msgdrop_cli import app
from msgdrop_cli.commands.parts.estimate import check_folder
from msgdrop_cli.commands.parts.options import (
    check_device,
    check_device_name,
    check_device_plays,
    check_workers,
)
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.profiles import profile_called
from msgdrop_cli.definition.seeds import parse_seeds
from msgdrop_cli.engine.facts import commit
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.errors import DefinitionError, MsgdropError, RecordError
from msgdrop_cli.records.files import BUSY, read_json, run_lock

LOG = "campaign.log"
_NO_CHECKPOINTS = "training.checkpoint_every_env_steps=1_000_000_000"
"""On a GPU a stacked figure fills gigabytes of replay in seconds: one is written at the end."""
_MOST_MINUTES = 100_000


def show_status(out: Path) -> int:
    """What campaign.json says, whether somebody is at work, and how far each run has come."""
    state = read_json(out / STATE)
    try:
        about, said = f"({state['phase']}, {state['written']})", counts(state["runs"])
    except (KeyError, TypeError) as error:
        raise RecordError(f"{out / STATE}: is damaged; a campaign writes it anew") from error
    at_work = False
    try:
        with run_lock(out):
            pass
    except RecordError as error:
        if error.exit_code != BUSY:
            raise
        at_work = True
    print("at work" if at_work else "not at work", about)
    print(said)
    return app.run(["status", str(out)])


def detach(arguments: Sequence[str], out: Path) -> int:
    """Start this command again in a session of its own, which outlives ours."""
    command = [sys.executable, str(Path(__file__).resolve()), *arguments]
    command.remove("--detach")
    with (out / LOG).open("ab") as log:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
        )
    print(f"process {process.pid} is at work; its log: {out / LOG}; {out / STATE} says the rest")
    return 0


def start(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Check what is asked, then do it; returns the exit code."""
    ends = time.monotonic() + 60 * options.minutes
    check_workers(options.workers)
    check_device_name(options.device)
    check_device(options.device)
    if commit() is None:
        raise DefinitionError(
            "this is no checkout, and records name their commit; say where this copy was made:"
            " MSGDROP_COMMIT=$(git describe --always --abbrev=40 --exclude='*' --dirty=+)"
        )
    on_gpu = [_NO_CHECKPOINTS] * (options.device == "cuda")
    seeds = None if options.seeds is None else parse_seeds(options.seeds)
    definition = load_definition(options.definition)
    profile_called(definition, options.profile)
    check_device_plays(definition.games(options.profile), options.device)
    asked = plan(
        definition,
        options.profile,
        catalogue(),
        overrides=[*on_gpu, *options.set],
        readings=options.reading,
        seeds=seeds,
    )
    check_folder(options.out, 0)
    if options.detach:
        return detach(arguments, options.out)
    with run_lock(options.out), graceful_stop() as control:
        campaign = Campaign(
            asked=asked,
            out=options.out,
            device=options.device,
            workers=options.workers,
            seeds_at_once=options.seeds_at_once or len(asked.runs),
            ends=ends,
            control=control,
        )
        try:
            campaign.carry_out()
        finally:
            runs = campaign.write_state("ended")
    return 3 if any(run["status"] in ("failed", "diverged") for run in runs) else 0


def main(arguments: Sequence[str]) -> int:
    """The command line; one line on stderr for what the user can mend."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("definition", nargs="?", help="name of a question, or FILE.toml")
    parser.add_argument("--minutes", type=float, help="everything is written when they are over")
    parser.add_argument("--out", type=Path, required=True, help="folder of runs and archives")
    parser.add_argument("--profile", default="paper")
    parser.add_argument("--device", default="cpu", help="cpu or cuda")
    parser.add_argument("--seeds", help="a number of seeds (3) or a list (1,5,9)")
    parser.add_argument("--set", action="append", default=[], help="algorithm.gamma=0.9")
    parser.add_argument("--reading", action="append", default=[], help="capture-once")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--seeds-at-once", type=int, help="on a GPU, stacked (default: all)")
    parser.add_argument("--detach", action="store_true", help="return at once, work on")
    parser.add_argument("--status", action="store_true", help="show how far --out has come")
    options = parser.parse_args(arguments)
    if not options.status and (options.definition is None or options.minutes is None):
        parser.error("expected a definition and --minutes, or --status")
    if not options.status and not 0 < options.minutes <= _MOST_MINUTES:
        parser.error(f"--minutes: expected more than 0, at most {_MOST_MINUTES:,}")
    if options.seeds_at_once is not None and options.seeds_at_once < 1:
        parser.error("--seeds-at-once: expected at least 1")
    try:
        return show_status(options.out) if options.status else start(options, arguments)
    except Stopped as stopped:
        print("campaign: stopped; the same command goes on", file=sys.stderr)
        return 128 + stopped.signal
    except MsgdropError as error:
        print(f"campaign: error: {error}", file=sys.stderr)
        return error.exit_code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
