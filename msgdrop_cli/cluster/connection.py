"""A client of the cluster that the user names, with certificates or without."""

import asyncio
import logging
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgdrop_cli.cluster import certificates
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import DefinitionError, RunError, to_install
from msgdrop_cli.signals import held_back

if TYPE_CHECKING:
    from distributed import Client

Answer = Future[Any]
"""What the cluster will say, once it does."""
_LOCAL, _DASK, _TLS = "local:", "dask://", "tls://"
_EXPECTED = "expected dask://HOST:PORT, tls://HOST:PORT or local:4 for workers of this machine"
_TLS_FILES = ("tls_ca_file", "tls_client_cert", "tls_client_key")
_MOST_LOCAL = 256
PATIENCE_S = 30.0
"""For a scheduler to answer, and for a cluster without workers until some come."""
_START_S, _MORE_S = 60.0, 2.0
"""For the first worker of this machine to begin, and more for each: loading takes a processor."""
_END_S = 2.0
"""For a process that is killed to be gone."""
_QUIET = 60
"""Dask's loggers say nothing below this: what matters we say ourselves, in a line."""


def check_cluster(where: str) -> str:
    """What `--cluster` names, as it is; DefinitionError if that is no cluster."""
    count = where.removeprefix(_LOCAL)
    local = where.startswith(_LOCAL) and _number(count) in range(1, _MOST_LOCAL + 1)
    if not local and not (where.startswith((_DASK, _TLS)) and _number(where.rpartition(":")[2])):
        raise DefinitionError(f"--cluster: {where[:60]!r} is none; {_EXPECTED}")
    return where


def _number(text: str) -> int:
    """A number of few digits; 0 for everything else, such as a `²`, which is a digit to Python."""
    return int(text) if text.isdecimal() and len(text) <= len("65535") else 0


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
    With them, or to a tls:// address, nothing is ever said without encryption.
    Raises RunError in a line: Dask is missing, nobody answers, or a certificate is wrong.
    """
    try:
        import distributed  # noqa: F401 - said before anything else
    except ImportError as error:
        raise RunError(f"--cluster needs Dask; {to_install('dask')}") from error
    for name in ("distributed", "distributed.client"):  # which has a level of its own
        logging.getLogger(name).setLevel(_QUIET)
    if tls and where.startswith(_LOCAL):
        raise RunError(f"{where} takes no --cluster-tls: its workers talk on this machine only")
    with _of_this_machine(where) if where.startswith(_LOCAL) else _client(where, tls) as client:
        yield client


def asked(client: "Client", method: Callable[..., Any], *words: Any, **options: Any) -> Answer:
    """Have Dask's own thread call a method of its client, and wait there for who is silent."""

    async def ask() -> Any:
        return await method(*words, **options)  # in that thread it returns what to await

    loop = client.loop.asyncio_loop  # type: ignore[union-attr]
    return asyncio.run_coroutine_threadsafe(ask(), loop)


@contextmanager
def _of_this_machine(where: str) -> Iterator["Client"]:
    """Workers that begin and end here."""
    import multiprocessing
    from multiprocessing import resource_tracker

    from distributed import Client, LocalCluster

    count = int(where.removeprefix(_LOCAL))
    with held_back():
        resource_tracker.ensure_running()  # it lets signals through afterwards
    patience_s = _START_S + _MORE_S * count
    others = multiprocessing.active_children()
    try:
        with held_back():  # its processes inherit that, and leave Ctrl-C to us
            made = LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                dashboard_address=None,
                silence_logs=_QUIET,
                death_timeout=patience_s,
            )
    except Exception as error:  # of many kinds, AssertionError too
        for _ in range(count + 1):  # Dask leaves one that was stopped, and may begin another
            for process in set(multiprocessing.active_children()).difference(others):
                process.kill()
                process.join(_END_S)
        raise RunError(
            f"{where}: a worker died before it was ready, or was not within {patience_s:.0f} s"
            " (no memory, or a busy machine?); ask again, perhaps with fewer, or for --workers"
        ) from error
    with made, Client(made) as client:
        yield client


def _client(where: str, tls: Sequence[Path]) -> "Client":
    """A client of a scheduler that runs already."""
    from distributed import Client, Security

    identity = certificates.read(tls) if tls else None
    files = dict(zip(_TLS_FILES, map(str, tls), strict=True)) if tls else {}
    security = Security(require_encryption=True, **files) if tls else Security()
    address = where.replace(_DASK, _TLS if tls else "tcp://")
    try:
        asyncio.run(_somebody_speaks(address, security.get_connection_args("client")))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a table of versions: `check_workers` has a line
            return Client(address, timeout=PATIENCE_S, security=security)
    except (OSError, ValueError, TypeError, ImportError) as error:
        reason = certificates.why_refused(identity) if identity else ""
        reason = reason or _in_words(error, address)
        raise RunError(one_line(f"{where}: no scheduler answers there: {reason}")) from error


async def _somebody_speaks(address: str, how: Mapping[str, Any]) -> None:
    """Raises what hinders a connection; Dask itself waits for ever for who takes it silently."""
    from distributed.comm.core import connect

    try:
        async with asyncio.timeout(PATIENCE_S + 1.0):
            comm = await connect(address, timeout=PATIENCE_S, **how)
    except TimeoutError as error:
        raise OSError("somebody takes the call, but says nothing") from error
    comm.abort()


def _in_words(error: Exception, address: str) -> str:
    """Why nobody answered."""
    if isinstance(error, TypeError) and address.startswith(_TLS):
        return "tls:// needs --cluster-tls CA,CERT,KEY, or Dask's own settings"
    if "certificate does not match" in str(error):  # Dask's word for any fault of the peer's
        return (
            f"its certificate is not to be trusted: {error.__cause__ or 'expired, or another CA'}"
        )
    if "Timed out" in str(error) or not address.startswith(_TLS):
        return str(error) or "it does not speak as Dask does"
    return f"no encrypted connection; it has none, or does not trust our certificate ({error})"
