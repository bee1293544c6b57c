"""Everybody hears the two agents whose numbers are next to its own.

"The scenario in which communication between limited pairs of agents is available" is all that the
paper says (l. 561); which pairs is ours.
"""


def senders(agents: int) -> list[list[int]]:
    """The one before and the one after, [N, 2]; [2, 1] and [1, 0] where there are no two others."""
    return [
        list(dict.fromkeys(j for j in ((i - 1) % agents, (i + 1) % agents) if j != i))
        for i in range(agents)
    ]
