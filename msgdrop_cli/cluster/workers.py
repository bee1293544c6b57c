"""The workers of a cluster before anything begins: could they do our work, and as we would?"""

import platform
from collections.abc import Iterable, Mapping
from concurrent.futures import wait
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgdrop_cli import __version__
from msgdrop_cli.cluster.connection import PATIENCE_S, asked
from msgdrop_cli.errors import RunError
from msgdrop_cli.records.temporary import TEMPORARY
from msgdrop_cli.signals import scratch_folder

if TYPE_CHECKING:
    from distributed import Client


@dataclass(frozen=True, slots=True)
class Workers:
    """What was found."""

    words: str
    """How many there are and where, in a line."""
    share: bool
    """Whether all of them see the results folder; if not, runs travel through the cluster."""
    notes: tuple[str, ...] = ()
    """What the user should know about them."""


def check_workers(client: "Client", root: Path) -> Workers:
    """Look at the workers; RunError for one that runs other code or does several tasks at once.

    root: the results folder, which they may see where it lies here.
    """
    with suppress(TimeoutError):
        client.wait_for_workers(1, timeout=PATIENCE_S)
    threads = client.nthreads()
    if not threads:
        raise RunError("the cluster has no workers; start some: dask worker --nthreads 1 ADDRESS")
    with scratch_folder(root, TEMPORARY) as probe:
        found = _answers(client, threads, probe)
    here = about(probe)
    for address, said in found.items():
        _check(f"worker {address}", said, here)
        if threads.get(address, 1) != 1:
            raise RunError(
                f"worker {address}: does several tasks at once, which share a"
                " processor's settings; start it with --nthreads 1"
            )
    hosts = {said["node"] for said in found.values()}
    share = all(said["sees"] for said in found.values())
    words = f"{len(found)} workers on {len(hosts)} machine{'s' * (len(hosts) != 1)}"
    if not share:
        words += "; they do not see the results folder: runs come back through the cluster"
    return Workers(words, share, _differences(found, here))


def _answers(client: "Client", workers: Iterable[str], probe: Path) -> dict[str, Any]:
    """By worker, what it says of itself; RunError for one that is silent."""
    run = partial(client.run, about, probe, on_error="return")
    answers = {address: asked(client, run, workers=[address]) for address in workers}
    wait(answers.values(), 2 * PATIENCE_S)  # who is cut off is given up by Dask meanwhile
    there = client.nthreads()
    for address in there:
        if address in answers and not answers[address].done():
            raise RunError(f"worker {address}: does not answer (stopped, or cut off?); end it")
    return {k: answer.result()[k] for k, answer in answers.items() if k in there}


def about(probe: Path) -> dict[str, Any]:
    """What a worker says of itself."""
    from msgdrop_cli.engine.facts import commit, host, versions

    return {
        "node": platform.node(),
        "sees": probe.exists(),
        "version": __version__,
        "commit": commit(),
        "same": versions() | {"processor": host()},
    }


def _check(worker: str, said: Any, here: Mapping[str, Any]) -> None:
    """Raises RunError if a worker's code is not ours."""
    if isinstance(said, BaseException):
        raise RunError(f"{worker}: msgdrop {__version__} cannot be used there: {said}")
    if said["version"] != __version__:
        raise RunError(f"{worker}: has msgdrop {said['version']}, not {__version__}")
    commits = said["commit"], here["commit"]
    if all(commits) and len(set(commits)) > 1:
        raise RunError(
            f"{worker}: has msgdrop at commit {_short(commits[0])}, not {_short(commits[1])}"
        )


def _short(commit: str) -> str:
    return commit[:12] + "+" * commit.endswith("+")


def _differences(found: Mapping[str, Any], here: Mapping[str, Any]) -> tuple[str, ...]:
    """What may make another last bit, a line for each difference, with the workers that have it."""
    who: dict[str, list[str]] = {}
    for address, said in found.items():
        there = said["same"]
        pairs = [
            f"{k} {there.get(k)}, here {v}" for k, v in here["same"].items() if there.get(k) != v
        ]
        if pairs:
            who.setdefault("; ".join(pairs), []).append(address)
    return tuple(
        f"worker {', '.join(addresses)}: {words}: last bits may differ"
        for words, addresses in who.items()
    )
