"""Everybody hears everybody: the paper's m^i = (m^1, ..., m^(i-1), m^(i+1), ..., m^N) (l. 149)."""


def senders(agents: int) -> list[list[int]]:
    """The others in increasing order, [N, N-1]."""
    return [[j for j in range(agents) if j != i] for i in range(agents)]
