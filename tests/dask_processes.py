"""Real processes of Dask, as people start them, for the tests of clusters."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from tests.cli_runs import ROOT
from tests.processes import wait_for

DASK = {
    **os.environ,
    "PYTHONPATH": os.pathsep.join(str(ROOT / p) for p in ("", "envs", "ablations")),
}


class Cluster(NamedTuple):
    """Processes of Dask on the loopback interface."""

    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]


def dask(folder: Path, kind: str, *arguments: str | Path) -> subprocess.Popen[bytes]:
    """A scheduler or a worker, as people start it."""
    module = f"distributed.cli.dask_{kind}"
    command = [sys.executable, "-m", module, "--no-dashboard", *map(str, arguments)]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(command, env=DASK, cwd=folder, stdout=quiet, stderr=quiet)


def worker(
    folder: Path, address: str, *options: str | Path, threads: int = 1
) -> subprocess.Popen[bytes]:
    """A worker without a nanny, so that whoever kills it has killed it."""
    usual = ("--nthreads", str(threads), "--no-nanny", "--local-directory", folder)
    return dask(folder, "worker", address, *usual, *options)


@contextmanager
def running(
    folder: Path, *, workers: int, options: Sequence[str | Path] = (), protocol: str = "tcp"
) -> Iterator[Cluster]:
    """A scheduler and some workers, all of them with these options, until the context ends."""
    file = folder / f"scheduler-{protocol}.json"
    where = ("--host", f"{protocol}://127.0.0.1", "--port", "0", "--scheduler-file", file)
    scheduler = dask(folder, "scheduler", *where, *options)
    begun: list[subprocess.Popen[bytes]] = []
    try:
        wait_for(lambda: file.exists() and file.read_text().endswith("}"))
        address = json.loads(file.read_text())["address"]
        begun += [worker(folder, address, *options) for _ in range(workers)]
        yield Cluster(address.replace("tcp://", "dask://"), scheduler, begun)
    finally:
        for process in (*begun, scheduler):
            process.kill()
            process.wait()
