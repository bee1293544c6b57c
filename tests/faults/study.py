"""A tiny real study, and processes that carry it out; a run takes a second.

Processes are forked off this one, which has loaded and warmed everything: a start takes
milliseconds instead of seconds, so that a fault can be tried hundreds of times. Each has a session
of its own, and dies with whoever started it.
"""

import contextlib
import ctypes
import os
import select
import shutil
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import torch

import msgdrop_cli.__main__ as program
from msgdrop_cli import app
from msgdrop_cli.engine import run as run_module
from msgdrop_cli.engine.checkpoint import Checkpoints
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.store import list_runs
from msgdrop_cli.signals import SIGNALS
from tests.faults.oracle import KEPT, check_same
from tests.faults.row import Broken, Trial, expect

STEPS, INTERVAL, LOGGED, GAMES = 480, 80, 40, 4
"""Env steps of a run, between two checkpoints, between two rows of its log, and between updates."""
QUESTION = f"""
title = "A tiny question"
question = "Does everything survive?"
source = "nobody"
environments = ["pursuit-n6"]
[variants."md-0.2"]
label = "DCC-MD 0.2"
algorithm = {{ name = "dcc-md", rate = 0.2 }}
[profiles.quick]
seeds = 2
evaluation_episodes = 4
environment = {{ time_limit = 20 }}
[profiles.quick.training]
train_env_steps = {STEPS}
games = {GAMES}
log_every_env_steps = {LOGGED}
checkpoint_every_env_steps = {INTERVAL}
[profiles.quick.algorithm]
replay_capacity = 200
replay_start_env_steps = 100
"""
_PATIENCE_S = 60.0
_PR_SET_PDEATHSIG, _PR_SET_PTRACER = 1, 0x59616D61


@dataclass(slots=True)
class Running:
    """A process that carries out a command line."""

    pid: int
    said_in: Path
    before_bytes: int = field(default_factory=lambda: _resident_bytes())
    grown: int = 0
    """Bytes of memory that it took at most, beyond what it shares with this process; at its end."""

    @property
    def said(self) -> str:
        """What it has said so far, on both streams."""
        return self.said_in.read_text(errors="replace")

    def send(self, signum: int = signal.SIGKILL) -> None:
        """Send a signal to it and to all that it started, if it still is there."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signum)

    def wait(self, seconds: float = _PATIENCE_S) -> int:
        """Its exit code, negative for a signal; raises Broken if it hangs."""
        handle = os.pidfd_open(self.pid)
        ended, _, _ = select.select([handle], [], [], seconds)
        os.close(handle)
        if not ended:
            self.send()
            os.waitpid(self.pid, 0)
            raise Broken(f"hung for {seconds:.0f} s: {self.last_line()}")
        _, status, used = os.wait4(self.pid, 0)
        self.grown = used.ru_maxrss * 1024 - self.before_bytes
        return os.waitstatus_to_exitcode(status)

    def last_line(self) -> str:
        """The last line of what it said."""
        return (self.said.splitlines() or ["(silent)"])[-1]


def make_bench(folder: Path) -> Path:
    """What all trials share: the question, and both seeds' undisturbed results."""
    (folder / "tiny.toml").write_text(QUESTION)
    for seeds in (1, 2):
        results = folder / f"undisturbed-{seeds}" / "results"
        results.parent.mkdir()
        process = start(command(folder, results, seeds=seeds), results.parent)
        expect(process.wait() == 0, process.last_line())
    return folder


def warm_up(folder: Path) -> None:
    """Load everything into this process, once, so that those forked off it begin at once."""
    torch.set_num_threads(1)
    (folder / "tiny.toml").write_text(QUESTION)
    with Path(os.devnull).open("w") as nothing:
        out, err, sys.stdout, sys.stderr = sys.stdout, sys.stderr, nothing, nothing
        try:
            code = app.run([*command(folder, folder / "none", seeds=1), "--dry-run"])
        finally:
            sys.stdout, sys.stderr = out, err
    expect(code == 0, f"the tiny question cannot be planned: {code}")
    import matplotlib.backends.backend_agg
    import matplotlib.figure  # noqa: F401


def command(bench: Path, results: Path, *, seeds: int = 1, workers: int = 1) -> list[str]:
    """The command line that carries out the study."""
    which = ["--seed", "1"] if seeds == 1 else ["--seeds", str(seeds)]
    where = ["--results", str(results), "--workers", str(workers)]
    return ["ablate", str(bench / "tiny.toml"), *which, *where]


def undisturbed(trial: Trial, seeds: int = 1) -> Path:
    """The results folder that nothing disturbed."""
    return trial.bench / f"undisturbed-{seeds}" / "results"


def seconds_undisturbed(trial: Trial) -> float:
    """How long one run takes here, by its own clock, with some more for what comes around it."""
    [record] = list_runs(undisturbed(trial))
    return float(record.run["wall_time_s"]) + 0.5


def start(arguments: Sequence[str], folder: Path, before: Callable[[], Any] = int) -> Running:
    """Begin to carry out a command line; its words go into a file in `folder`.

    before: called in the new process first.
    """
    said = folder / f"said-{time.monotonic_ns()}"
    said.touch()
    sys.stdout.flush()
    if pid := os.fork():
        return Running(pid, said)
    try:
        _become(arguments, said, before)
    except BaseException as error:
        os.write(2, f"{type(error).__name__}: {error}".encode())
    finally:
        os._exit(99)


def go_on(trial: Trial, arguments: Sequence[str], *, seeds: int = 1) -> None:
    """The same command again: it ends well, and nothing shows that there was a fault."""
    results = Path(arguments[arguments.index("--results") + 1])
    process = start(arguments, trial.folder)
    code = process.wait()
    expect(code == 0, f"the same command again ended with {code}: {process.last_line()}")
    check_same(undisturbed(trial, seeds), results)
    check_tidy(results)


def check_tidy(results: Path) -> None:
    """Nothing temporary and no checkpoint is left of finished runs."""
    left = [path for path in results.rglob("*") if path.name.startswith((".tmp-", "checkpoints"))]
    expect(not left, f"left behind: {left[:3]}")


def newest_checkpoint(results: Path) -> int:
    """Env steps of the newest checkpoint of a study of one run, 0 without one."""
    return max((int(path.name) for path in results.glob("runs/*/*/checkpoints/0*")), default=0)


def wait_until(fact: Callable[[], object], process: Running, seconds: float = 30.0) -> bool:
    """Whether something came to be while the process ran."""
    end = time.monotonic() + seconds
    while not fact():
        if os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            return False
        expect(time.monotonic() < end, "waited in vain")
        time.sleep(0.002)
    return True


def slowness() -> float:
    """How many processes share a processor here: limits hold for a machine that is idle."""
    return max(os.getloadavg()[0] / (os.cpu_count() or 1), 1.0)


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def _become(arguments: Sequence[str], said: Path, before: Callable[[], Any]) -> NoReturn:
    """Be `msgdrop` in a process that has just been forked off."""
    libc = ctypes.CDLL(None)
    libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    libc.prctl(_PR_SET_PTRACER, ctypes.c_ulong(-1), 0, 0, 0)  # strace is no ancestor of ours
    os.setsid()
    for each in SIGNALS:  # a shell's background jobs ignore Ctrl-C
        signal.signal(each, signal.SIG_DFL)
    handle = os.open(said, os.O_WRONLY | os.O_APPEND)
    for stream, target in ((os.open(os.devnull, os.O_RDONLY), 0), (handle, 1), (handle, 2)):
        os.dup2(stream, target)
    sys.modules["__main__"] = program
    sys.argv = ["msgdrop", *arguments]
    run_module._PUT_OFF = 0  # a slow disk puts off no checkpoint: the oracle looks at the last
    remove, finish = Checkpoints.remove, run_module._Session._finish

    def finish_with_a_checkpoint(session: run_module._Session) -> list[Outcome]:
        session._checkpoint()  # the oracle wants one of the end
        return finish(session)

    def keep_aside(checkpoints: Checkpoints) -> None:
        run = checkpoints._run_path
        kept = run.parents[2].parent / KEPT / run.name
        try:
            shutil.copytree(run / "checkpoints", kept / "checkpoints", dirs_exist_ok=True)
        except OSError:  # the disk is full, by our own doing: the oracle goes without
            shutil.rmtree(kept, ignore_errors=True)
        remove(checkpoints)

    Checkpoints.remove = keep_aside  # type: ignore[method-assign, assignment]
    run_module._Session._finish = finish_with_a_checkpoint  # type: ignore[method-assign, assignment]
    before()
    try:
        program.main()
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 1
    sys.stdout.flush()
    os._exit(code)
