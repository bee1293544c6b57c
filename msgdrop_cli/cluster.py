"""Tasks on a Dask cluster whose workers see the same results folder; no other way to share records.

joblib's own Dask backend waits for ever where a worker keeps dying, since it hears of results only,
and it cannot say which worker has what; so tasks go to Dask itself. What a run is, who may write
it and how it goes on is the scheduler's and the records' business, as everywhere.
"""

import logging
import os
import platform
import secrets
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgdrop_cli import __version__
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import DefinitionError, RecordError, RunError, to_install
from msgdrop_cli.records.files import TEMPORARY, run_lock
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.store import set_status
from msgdrop_cli.scheduler import TRIES, Arrived, Elsewhere, Task, lost, work
from msgdrop_cli.signals import held_back, scratch_folder
from msgdrop_cli.stopping import Control

if TYPE_CHECKING:
    from distributed import Client, Security

_LOCAL, _DASK, _TLS = "local:", "dask://", "tls://"
_EXPECTED = "expected dask://HOST:PORT, tls://HOST:PORT or local:4 for workers of this machine"
_TLS_FILES = ("tls_ca_file", "tls_client_cert", "tls_client_key")
_MOST_LOCAL = 256
_PATIENCE_S = 30.0
"""For a scheduler to answer and the first workers to come."""
_BEAT_S = 5.0
_QUIET = 60
"""Dask's loggers say nothing below this: what matters we say ourselves, in a line."""
_SILENCE_S = 120.0
"""Workers stop with a checkpoint if the command that began them has been silent for so long."""


@dataclass(slots=True)
class SharedControl(Control):
    """A control that workers on other machines find in the results folder.

    The owner writes a number behind the first byte again and again: a file does not go with its
    process as memory does, and nobody waits for work whose owner was killed.
    """

    heard: str = ""
    since: float = 0.0
    """When the number was last a new one, by this process's own clock."""

    def beat(self, number: int) -> None:
        """Say that the owner lives."""
        os.pwrite(self.descriptor, f"{number:08}".encode(), 1)

    def stopping(self) -> bool:
        """Whether everybody should write checkpoints and return."""
        try:
            line = self.path.read_text().partition("\n")[0]
        except OSError:
            return True
        if line != self.heard:
            self.heard, self.since = line, time.monotonic()
        return line[:1] == "1" or time.monotonic() - self.since > _SILENCE_S


def check_cluster(where: str) -> str:
    """What `--cluster` names, as it is; DefinitionError if that is no cluster."""
    count = where.removeprefix(_LOCAL)
    local = where.startswith(_LOCAL) and count.isdigit() and 1 <= int(count) <= _MOST_LOCAL
    if not local and not (where.startswith((_DASK, _TLS)) and where.rpartition(":")[2].isdigit()):
        raise DefinitionError(f"--cluster: {where[:60]!r} is none; {_EXPECTED}")
    return where


def check_tls(text: str) -> tuple[Path, ...]:
    """The files of `--cluster-tls CA,CERT,KEY`; DefinitionError unless all three are there."""
    files = tuple(Path(word).expanduser() for word in text.split(","))
    if len(files) != len(_TLS_FILES):
        raise DefinitionError("--cluster-tls: expected three files: CA,CERT,KEY")
    if missing := [file for file in files if not file.is_file()]:
        raise DefinitionError(one_line(f"--cluster-tls: {missing[0]}: there is no such file"))
    return files


@contextmanager
def connected(where: str, tls: Sequence[Path] = ()) -> Iterator["Client"]:
    """A client of the cluster that `check_cluster` let through; one of this machine ends with it.

    tls: files of the authority, the certificate and its key, if Dask's own settings have none.
    Raises RunError in a line: Dask is missing, nobody answers, or there are no workers.
    """
    from multiprocessing import resource_tracker

    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise RunError(f"--cluster needs Dask; {to_install('dask')}") from error
    logging.getLogger("distributed").setLevel(_QUIET)
    security = _security(tls) if tls else None
    if where.startswith(_LOCAL):
        count = int(where.removeprefix(_LOCAL))
        with held_back():
            resource_tracker.ensure_running()  # it lets signals through afterwards
        with held_back():  # its processes inherit that, and leave Ctrl-C to us
            made = LocalCluster(
                n_workers=count, threads_per_worker=1, dashboard_address=None, silence_logs=_QUIET
            )
        with made, Client(made) as client:
            yield client
        return
    address = where.replace(_DASK, "tls://" if tls else "tcp://")
    try:
        client = Client(address, timeout=_PATIENCE_S, security=security)
    except (OSError, ValueError, TypeError) as error:
        raise RunError(f"{where}: no scheduler answers there: {error}") from error
    with client:
        yield client


def check_workers(client: "Client", root: Path) -> str:
    """Refuse (RunError) workers that could not do our work; returns how many there are and where.

    Each must run this version of msgdrop, see `root` where it lies here, and do one task at once.
    """
    with suppress(TimeoutError):
        client.wait_for_workers(1, timeout=_PATIENCE_S)
    threads = client.nthreads()
    if not threads:
        raise RunError("the cluster has no workers; start some: dask worker --nthreads 1 ADDRESS")
    probe = root / f".cluster-{secrets.token_hex(4)}"
    probe.touch()
    try:
        found = client.run(_about, probe, on_error="return")
    finally:
        probe.unlink(missing_ok=True)
    for address, said in found.items():
        if isinstance(said, BaseException):
            raise RunError(f"worker {address}: msgdrop cannot be used there: {said}")
        if said["version"] != __version__:
            raise RunError(f"worker {address}: has msgdrop {said['version']}, not {__version__}")
        if not said["sees"]:
            raise RunError(
                f"worker {address}: does not see {root}; results must be on a drive"
                " that all machines share, under the same path"
            )
        if threads.get(address, 1) != 1:
            raise RunError(
                f"worker {address}: does several tasks at once, which share a"
                " processor's settings; start it with --nthreads 1"
            )
    hosts = {said["node"] for said in found.values()}
    return f"{len(found)} workers on {len(hosts)} machine{'s' * (len(hosts) != 1)}"


@contextmanager
def shared_control(root: Path) -> Iterator[Control]:
    """A control in the results folder, which goes with this context."""
    with scratch_folder(root, TEMPORARY) as folder:
        yield from _beating(folder / "control")


def _beating(path: Path) -> Iterator[Control]:
    """A control that is told again and again that its owner lives."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    over = threading.Event()
    control = SharedControl(path, descriptor)

    def beat() -> None:
        number = 0
        while not over.wait(_BEAT_S):
            number += 1
            control.beat(number)

    thread = threading.Thread(target=beat, daemon=True)
    try:
        os.write(descriptor, b"000000000\n")
        thread.start()
        yield control
    finally:
        over.set()
        if thread.ident:
            thread.join()
        os.close(descriptor)


def on(client: "Client") -> Elsewhere:
    """What does the scheduler's tasks on this cluster (`run_tasks(elsewhere=...)`).

    A task whose worker dies is begun again elsewhere, TRIES times in all; what is lost with the
    cluster itself has failed, and goes on when it is asked for again.
    """

    def do(tasks: Sequence[Task], control: Control, arrived: Arrived) -> None:
        from distributed import as_completed

        futures = {
            client.submit(_work, task, control, pure=False, retries=0): task for task in tasks
        }
        for future in as_completed(futures):
            task = futures.pop(future)
            if future.status == "finished":
                arrived(future.result())
                continue
            error = future.exception() if future.status == "error" else None
            reason = f"{type(error).__name__}: {error}" if error else "the scheduler has gone"
            if type(error).__name__ == "KilledWorker":
                reason = f"its workers died {TRIES} times (killed, or out of memory?)"
            arrived([lost(task, run_id, f"cluster: {reason}") for run_id in task.run_ids])

    return do


def _security(tls: Sequence[Path]) -> "Security":
    from distributed import Security

    files = dict(zip(_TLS_FILES, map(str, tls), strict=True))
    return Security(require_encryption=True, **files)


def _work(task: Task, control: Control) -> list[Outcome]:
    """What a worker does: the scheduler's own work; the record says on which machine."""
    outcomes = work(task, control)
    for outcome in outcomes:
        if outcome.path is not None and outcome.status != "interrupted":
            with suppress(RecordError), run_lock(outcome.path):
                set_status(outcome.path, outcome.status, outcome.reason, node=platform.node())
    return outcomes


def _about(probe: Path) -> dict[str, Any]:
    """What a worker says of itself."""
    return {"version": __version__, "node": platform.node(), "sees": probe.exists()}
