"""Who hears whom, one file a topology: its name in definitions is that of its file.

A topology says of every agent whom it hears, in the order of the message slots of its network.
"""

from collections.abc import Sequence
from types import ModuleType

from msgdrop_cli.definition.modules import modules_in
from msgdrop_cli.errors import nearest

Senders = Sequence[Sequence[int]]
"""[N, S]: for each agent, the agents that it hears, itself never among them."""


def topologies() -> dict[str, ModuleType]:
    """The topologies' modules by name; each has `senders(agents) -> Senders`."""
    return modules_in(__name__, __path__)


def senders(topology: str, agents: int) -> Senders:
    """Whom each of the agents hears; ValueError for an unknown topology."""
    check_topology(topology)
    found: Senders = topologies()[topology].senders(agents)
    return found


def check_topology(name: str) -> None:
    """ValueError if no topology is called so."""
    known = topologies()
    if name not in known:
        raise ValueError(f"topology: none is called {name[:64]!r}; {nearest(name[:64], known)}")
