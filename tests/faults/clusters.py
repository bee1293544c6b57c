"""Trials on Dask: the scheduler is killed; a worker is killed, stopped, or cut off."""

import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from tests.faults.oracle import check_same
from tests.faults.row import NotHere, Trial, expect
from tests.faults.study import (
    Running,
    command,
    go_on,
    seconds_undisturbed,
    slowness,
    start,
    undisturbed,
    wait_until,
)
from tests.processes import children, command_line

_TIME_TO_LIVE_S, _BEYOND_S = 10, 30
"""Dask's is 300 s; the trials would only wait longer."""
_SETTINGS = {"distributed.scheduler.worker-ttl": f"{_TIME_TO_LIVE_S} s"}


def lose_a_part(trial: Trial) -> float:
    """Once a run has begun: a result or an error in time, and it goes on when asked again."""
    kinds = (_kill_the_scheduler, _kill_a_worker, _stop_a_worker, _cut_a_worker_off)
    kind = kinds[trial.number % len(kinds)]
    what = kind.__name__.strip("_").replace("_", " ")
    results = trial.folder / "results"
    processes: list[Running] = []
    try:
        process, disturb = kind(trial, results, processes)
        wait_until(lambda: [*results.glob("runs/*/*/metrics.jsonl")], process, 120.0)
        time.sleep(trial.rng.uniform(0.0, 0.5 * seconds_undisturbed(trial)))
        disturb()
        began = time.monotonic()
        code = process.wait((_TIME_TO_LIVE_S + _BEYOND_S) * slowness())
        took = time.monotonic() - began
        expect(code in (0, 3), f"{what}: ended with {code}: {process.last_line()}")
        expect("Traceback" not in process.said, f"{what}: a traceback was shown")
    finally:
        for each in processes:
            each.send()
    if code == 0:
        check_same(undisturbed(trial, 2), results)
    go_on(trial, command(trial.bench, results, seeds=2), seeds=2)
    return took


Disturbed = tuple[Running, Callable[[], object]]
"""A study at work, and what disturbs it."""


def _kill_a_worker(trial: Trial, results: Path, processes: list[Running]) -> Disturbed:
    return _on_a_local_one(trial, results, processes, signal.SIGKILL)


def _stop_a_worker(trial: Trial, results: Path, processes: list[Running]) -> Disturbed:
    return _on_a_local_one(trial, results, processes, signal.SIGSTOP)


def _on_a_local_one(
    trial: Trial, results: Path, processes: list[Running], signum: int
) -> Disturbed:
    """`--cluster local:2`: the scheduler and its nannies live in the command itself."""
    process = start(_on("local:2", trial, results), trial.folder, _set)
    processes.append(process)

    def disturb() -> None:
        workers = [pid for pid in children(process.pid) if b"spawn_main" in command_line(pid)]
        if workers:  # else it has ended
            os.kill(trial.rng.choice(workers), signum)

    return process, disturb


def _kill_the_scheduler(trial: Trial, results: Path, processes: list[Running]) -> Disturbed:
    address = _scheduler(trial, processes)
    for _ in range(2):
        _worker(trial, processes, address)
    process = start(_on(address.replace("tcp", "dask"), trial, results), trial.folder, _set)
    return process, processes[0].send


def _cut_a_worker_off(trial: Trial, results: Path, processes: list[Running]) -> Disturbed:
    """One of two workers reaches the scheduler by a relay, which falls silent."""
    address = _scheduler(trial, processes)
    _worker(trial, processes, address)
    silent = threading.Event()
    _worker(trial, processes, f"tcp://127.0.0.1:{_relay(int(address.rpartition(':')[2]), silent)}")
    process = start(_on(address.replace("tcp", "dask"), trial, results), trial.folder, _set)
    return process, silent.set


def _on(where: str, trial: Trial, results: Path) -> list[str]:
    plain = command(trial.bench, results, seeds=2)
    place = plain.index("--workers")
    return [*plain[:place], *plain[place + 2 :], "--cluster", where]


def _scheduler(trial: Trial, processes: list[Running]) -> str:
    file = trial.folder / "scheduler.json"
    options = ("--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))
    processes.append(_dask(trial, "dask_scheduler", *options))
    wait_until(
        lambda: file.exists() and file.read_text().endswith("}"), processes[-1], seconds=60.0
    )
    return file.read_text().split('"address": "')[1].split('"')[0]


def _worker(trial: Trial, processes: list[Running], address: str) -> None:
    folder = trial.folder / f"worker-{len(processes)}"
    folder.mkdir()
    options = ("--nthreads", "1", "--no-nanny", "--local-directory", str(folder))
    processes.append(_dask(trial, "dask_worker", address, *options))


def _dask(trial: Trial, kind: str, *arguments: str) -> Running:
    """A scheduler or a worker in a process that has everything loaded."""
    return start([], trial.folder, partial(_be, kind, ("--no-dashboard", *arguments)))


def _be(kind: str, arguments: Sequence[str]) -> None:
    _set()
    from importlib import import_module

    import_module(f"distributed.cli.{kind}").main(arguments)  # ends the process


def _set() -> None:
    try:
        import dask
        import distributed  # noqa: F401
    except ImportError as error:
        raise NotHere("distributed is not installed") from error
    dask.config.set(_SETTINGS)


def _relay(port: int, silent: threading.Event) -> int:
    """Pass bytes on to a port of this machine until it falls silent; returns the port to ask."""
    listener = socket.create_server(("127.0.0.1", 0))

    def accept() -> None:
        while True:
            here, _ = listener.accept()
            there = socket.create_connection(("127.0.0.1", port))
            for pair in ((here, there), (there, here)):
                threading.Thread(target=carry, args=pair, daemon=True).start()

    def carry(source: socket.socket, target: socket.socket) -> None:
        while content := source.recv(2**16):
            if silent.is_set():
                return
            target.sendall(content)
        target.shutdown(socket.SHUT_WR)

    threading.Thread(target=accept, daemon=True).start()
    return int(listener.getsockname()[1])
