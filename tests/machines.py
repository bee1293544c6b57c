"""As near to several machines as one comes: own addresses, host names and folders for temporaries.

Network namespaces of Linux on one bridge, which is in a namespace, too: nothing of this machine's
network is touched. It takes the superuser.
"""

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tests.dask_processes import DASK

PORT = 8786


class Machines:
    """Namespaces by their names, with addresses 10.77.0.1, 10.77.0.2 and so on, in this order."""

    def __init__(self, names: Sequence[str]) -> None:
        self.prefix = f"msgdrop{os.getpid()}-"
        self.names = list(names)
        self.begun: list[subprocess.Popen[bytes]] = []

    def address(self, name: str) -> str:
        """Where the others find it."""
        return f"10.77.0.{self.names.index(name) + 1}"

    def build(self) -> None:
        """Make them, and the bridge that they hang on."""
        self._ip("netns", "add", self.prefix + "hub")
        self._ip(*self._in("hub"), "link", "add", "bridge", "type", "bridge")
        self._ip(*self._in("hub"), "link", "set", "bridge", "up")
        for name in self.names:
            peer = ("peer", "name", name, "netns", self.prefix + "hub")
            self._ip("netns", "add", self.prefix + name)
            self._ip(*self._in(name), "link", "add", "wire", "type", "veth", *peer)
            self._ip(*self._in("hub"), "link", "set", name, "master", "bridge", "up")
            self._ip(*self._in(name), "addr", "add", f"{self.address(name)}/24", "dev", "wire")
            for device in ("lo", "wire"):
                self._ip(*self._in(name), "link", "set", device, "up")

    def tear_down(self) -> None:
        """End what runs on them, and take them away."""
        for process in self.begun:
            process.kill()
            process.wait()
        for name in (*self.names, "hub"):
            subprocess.run(["ip", "netns", "del", self.prefix + name], capture_output=True)

    def begin(self, name: str, *words: str | Path, shares: bool = False) -> subprocess.Popen[bytes]:
        """Python with these words on a machine; its /tmp is its own unless it `shares` ours."""
        own = "mount -t tmpfs tmpfs /tmp && " * (not shares)
        script = f'hostname {name} && cd / && {own}exec "$@"'
        alone = ("ip", "netns", "exec", self.prefix + name, "unshare", "--mount", "--uts")
        command = [*alone, "sh", "-c", script, "sh", sys.executable, *map(str, words)]
        out = subprocess.PIPE if shares else subprocess.DEVNULL
        process = subprocess.Popen(
            command, env=DASK, stdout=out, stderr=subprocess.STDOUT if shares else out
        )
        self.begun.append(process)
        return process

    def scheduler(self, name: str) -> subprocess.Popen[bytes]:
        """The scheduler of Dask."""
        options = ("--no-dashboard", "--host", self.address(name), "--port", str(PORT))
        return self.begin(name, "-m", "distributed.cli.dask_scheduler", *options)

    def worker(self, name: str, scheduler: str) -> subprocess.Popen[bytes]:
        """A worker as people start it, with its nanny."""
        options = ("--no-dashboard", "--nthreads", "1", "--host", self.address(name))
        where = f"tcp://{self.address(scheduler)}:{PORT}"
        return self.begin(name, "-m", "distributed.cli.dask_worker", where, *options)

    def cut(self, name: str) -> None:
        """From now on nothing comes from it nor reaches it; its own end of the wire looks well."""
        self._ip(*self._in("hub"), "link", "set", name, "nomaster")

    def mend(self, name: str) -> None:
        """Its wire is whole again."""
        self._ip(*self._in("hub"), "link", "set", name, "master", "bridge")

    def _in(self, name: str) -> tuple[str, ...]:
        return ("-n", self.prefix + name)

    def _ip(self, *words: str) -> None:
        subprocess.run(["ip", *words], check=True, capture_output=True)


def permitted() -> bool:
    """Whether this machine lets us make such namespaces."""
    try:
        with machines("probe"):
            return True
    except (OSError, subprocess.CalledProcessError):
        return False


@contextmanager
def machines(*names: str) -> Iterator[Machines]:
    """Machines of these names, until the context ends."""
    made = Machines(names)
    try:
        made.build()
        yield made
    finally:
        made.tear_down()
